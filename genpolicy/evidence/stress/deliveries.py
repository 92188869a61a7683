"""Answers on their way: delivered, overdue, or waiting for the check of another candidate."""

from collections import deque

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.stress.state import InFlight, Setup, Tally, next_candidate
from genpolicy.execution.cell import LateChunk
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal

ROUNDING_S = 1e-9


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
            classical fallback for it; else empty.
    """

    def __init__(
        self, setup: Setup, executor: Executor, journal: Journal, tally: Tally, *, start: int
    ) -> None:
        self.late_in = ""
        self._setup, self._executor = setup, executor
        self._journal, self._tally, self._start = journal, tally, start
        self._flying: list[InFlight] = []
        self._arrived: deque[InFlight] = deque()

    def add(self, flying: InFlight) -> None:
        """An invocation that has begun."""
        self._flying.append(flying)

    def collect(self, now_s: float) -> None:
        """What is delivered by now arrives, in order; what is overdue is given up."""
        self.late_in = ""
        for flying in sorted(self._flying, key=_order):
            if flying.arrival_s <= now_s and not flying.dropped:
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
        if flying.arrival_s <= now_s:
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
        if late > execution.replan_lead_steps and falls_back:
            self.late_in = phase
        if late >= self._setup.horizons.execution_horizon:
            self.answered(flying, now_s)
            self.write_off(flying, DiscardReason.EXPIRED, now_s)
        else:
            self._arrived.append(flying)

    def _overdue(self, flying: InFlight, now_s: float) -> bool:
        return now_s - flying.begun_s >= self._setup.execution.deadline_s - ROUNDING_S

    def _miss(self, flying: InFlight, now_s: float) -> None:
        """The deadline has passed: the next invocation may begin; the chunk may still come."""
        if not flying.given_up:
            flying.given_up = True
            self._tally.deadline_misses += 1
            self._executor.end_invocation(now_s, flying.metadata.chunk_id, "deadline")
        if flying.dropped:
            self._flying.remove(flying)
            self.write_off(flying, DiscardReason.EXPIRED, now_s)


def _order(flying: InFlight) -> tuple[float, int]:
    """Answers are judged in the order in which they come."""
    return flying.arrival_s, flying.number
