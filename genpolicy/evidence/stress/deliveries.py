"""Answers on their way: delivered, overdue, or waiting for the check of another candidate.

A term that takes longer than it may is dealt with as declared (`execution.term_deadlines`): where
its action ends the invocation, at the first tick after the time of the term is over; where it
refuses a candidate or the answer, when that comes. A policy in a process of its own that failed
gives no answer: its deadline is missed, and the journal says beside it how it failed.
"""

from collections import deque

from genpolicy.candidates.selector import tries_another
from genpolicy.contract.chunk import DiscardReason
from genpolicy.contract.latency import ENDING, DeadlineAction, Overrun
from genpolicy.evidence.stress.state import InFlight, Setup, Tally, next_candidate
from genpolicy.execution.cell import LateChunk
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal

ROUNDING_S = 1e-9
OVERRUN = "overrun"
"""Stage and end of an invocation in the journal, where a term took longer than it may."""
FAULT = "fault"
"""Stage of one that missed its deadline because the policy's process failed; how, is its detail."""


class Deliveries:
    """The invocations of one rollout that have not been judged to their end.

    Args:
        setup: What the rollout shares with the others.
        executor: Is told which invocations are in flight.
        journal: Of the rollout.
        tally: Its counts.
        start: Index of the initial state; key of the draws.

    Attributes:
        late_in: Phase of an answer that came late at the last tick, if that phase declares the
            classical fallback for it, or of one a term of which does; else empty.
        late_cause: Which of the two, as recovery records it.
    """

    def __init__(
        self, setup: Setup, executor: Executor, journal: Journal, tally: Tally, *, start: int
    ) -> None:
        self.late_in = self.late_cause = ""
        self._setup, self._executor = setup, executor
        self._journal, self._tally, self._start = journal, tally, start
        self._flying: list[InFlight] = []
        self._arrived: deque[InFlight] = deque()
        self._skipped: list[InFlight] = []

    def add(self, flying: InFlight) -> None:
        """An invocation that has begun."""
        self._flying.append(flying)

    def collect(self, now_s: float) -> None:
        """What is delivered by now arrives, in order; what is overdue is given up."""
        self.late_in = self.late_cause = ""
        for flying in self._skipped:
            self._missed(flying, now_s, OVERRUN)
        self._skipped.clear()
        for flying in sorted(self._flying, key=_order):
            if self._cut_short(flying, now_s):
                self._flying.remove(flying)
            elif flying.arrival_s <= now_s and flying.comes:
                self._flying.remove(flying)
                self._arrive(flying, now_s)
            elif self._overdue(flying, now_s):
                self._miss(flying, now_s)

    def first(self) -> InFlight | None:
        """The answer that is judged next."""
        return self._arrived[0] if self._arrived else None

    def take(self) -> InFlight:
        """The same, to be judged."""
        return self._arrived.popleft()

    def late_rows(self, flying: InFlight, now_s: float) -> int:
        """Rows of its chunk that are over."""
        late_s = now_s - flying.metadata.action_start_time_s
        return round(late_s / self._setup.horizons.action_period_s)

    def try_another(self, flying: InFlight, now_s: float) -> None:
        """The next candidate: at this tick if its check is done by now, else at a later one."""
        check_s = next_candidate(self._setup, flying, start=self._start)
        self._journal.invocation(
            now_s, invocation_id=flying.metadata.chunk_id, stage="check", detail=repr(check_s)
        )
        self._tally.latencies_s[flying.number] += check_s
        if self._cut_short(flying, now_s):
            return
        if flying.arrival_s <= now_s:
            if not self._refused_unjudged(flying, now_s):
                waiting = [*self._arrived, flying]
                self._arrived = deque(sorted(waiting, key=_order))
            return
        self._flying.append(flying)
        if self._overdue(flying, now_s):
            self._miss(flying, now_s)

    def answered(self, flying: InFlight, now_s: float) -> None:
        """The next invocation may begin, unless the deadline let it begin before."""
        if not flying.given_up:
            self._executor.end_invocation(now_s, flying.metadata.chunk_id, "answered")

    def write_off(self, flying: InFlight, reason: DiscardReason, now_s: float) -> None:
        """Account for a chunk that is never delivered."""
        chunks = flying.chunks
        rows = self._setup.horizons.prediction_horizon if chunks is None else int(chunks.shape[1])
        self._executor.write_off(flying.metadata, rows, reason, now_s)

    def end(self, now_s: float) -> None:
        """The episode is over, and with it all that was on its way."""
        for flying in [*self._flying, *self._arrived]:
            self.write_off(flying, DiscardReason.END_OF_EPISODE, now_s)
        self._flying.clear()
        self._arrived.clear()

    def _arrive(self, flying: InFlight, now_s: float) -> None:
        late, execution = self.late_rows(flying, now_s), self._setup.execution
        phase = flying.metadata.task_phase
        falls_back = execution.late_by_phase.get(phase) == LateChunk.FALLBACK
        if late > execution.replan_lead_rows and falls_back:
            self.late_in, self.late_cause = phase, "late chunk"
        if self._refused_unjudged(flying, now_s):
            return
        if late >= self._setup.horizons.execution_horizon:
            self.answered(flying, now_s)
            self.write_off(flying, DiscardReason.EXPIRED, now_s)
        else:
            self._arrived.append(flying)

    def _cut_short(self, flying: InFlight, now_s: float) -> bool:
        """Whether the invocation ends here, because a term took longer than it may."""
        for overrun in list(flying.overran):
            ends = overrun.action in ENDING
            on_arrival = not ends and overrun.action != DeadlineAction.CONTINUE
            if on_arrival or not flying.exposed_s + overrun.known_s <= now_s + ROUNDING_S:
                continue
            self._note(flying, overrun, now_s)
            if ends:
                if overrun.action == DeadlineAction.FALLBACK:
                    self.late_in = flying.metadata.task_phase
                    self.late_cause = f"overrun of {overrun.term}"
                skips = overrun.action == DeadlineAction.SKIP_INVOCATION
                self._give_up(flying, now_s, at_once=not skips)
                return True
        return False

    def _refused_unjudged(self, flying: InFlight, now_s: float) -> bool:
        """Whether what comes is refused because its transport or its check took too long."""
        refused = {overrun.action: overrun for overrun in flying.overran}
        if stale := refused.get(DeadlineAction.REJECT_STALE):
            self._note(flying, stale, now_s)
            self._give_up(flying, now_s)
        elif unchecked := refused.get(DeadlineAction.REJECT_CANDIDATE):
            self._note(flying, unchecked, now_s)
            if tries_another(flying.candidate, flying.candidates, stale=False):
                self.try_another(flying, now_s)
            else:
                self._give_up(flying, now_s)
        else:
            return False
        return True

    def _note(self, flying: InFlight, overrun: Overrun, now_s: float) -> None:
        flying.overran.remove(overrun)
        self._tally.overruns[overrun.term, overrun.action] += 1
        self._journal.invocation(
            now_s,
            invocation_id=flying.metadata.chunk_id,
            stage=OVERRUN,
            detail=f"{overrun.term} {overrun.action}",
        )

    def _give_up(self, flying: InFlight, now_s: float, *, at_once: bool = True) -> None:
        """No answer comes of it any more: a missed deadline, of the term and not of the whole."""
        if not flying.given_up:
            flying.given_up = True
            if at_once:
                self._missed(flying, now_s, OVERRUN)
            else:
                self._skipped.append(flying)
        self.write_off(flying, DiscardReason.EXPIRED, now_s)

    def _missed(self, flying: InFlight, now_s: float, why: str) -> None:
        """Counted where it is written down, so that row and journal count alike."""
        name = flying.metadata.chunk_id
        if flying.fault:
            self._tally.faults[flying.fault] += 1
            self._journal.invocation(now_s, invocation_id=name, stage=FAULT, detail=flying.fault)
        self._tally.deadline_misses += 1
        self._executor.end_invocation(now_s, name, why)

    def _overdue(self, flying: InFlight, now_s: float) -> bool:
        return now_s - flying.exposed_s >= self._setup.execution.deadline_s - ROUNDING_S

    def _miss(self, flying: InFlight, now_s: float) -> None:
        """The deadline has passed: the next invocation may begin; the chunk may still come."""
        if not flying.given_up:
            flying.given_up = True
            self._missed(flying, now_s, "deadline")
        if not flying.comes:
            self._flying.remove(flying)
            self.write_off(flying, DiscardReason.EXPIRED, now_s)


def _order(flying: InFlight) -> tuple[float, int]:
    """Answers are judged in the order in which they come."""
    return flying.arrival_s, flying.number
