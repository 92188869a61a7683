"""The loop of the supervisor's process: a tick each control period, whatever anybody else does.

Ticks follow a monotonic clock; between them, and never for longer than a bounded amount of work,
channels are read and verdicts are taken. A clock that stands still, goes back or leaps paces
nothing: then the loop waits by the system's timer, every tick holds, and after the silence that
stops it is an E-stop.
"""

import math
import select
import time
from collections.abc import Callable

from genpolicy.execution.believed import LONGEST_JUMP_NS
from genpolicy.execution.nanoseconds import NS_PER_S
from genpolicy.wall_clock.admission import AdmissionThread
from genpolicy.wall_clock.channel import Inbox, Outbox
from genpolicy.wall_clock.messages import read_answer, read_operator
from genpolicy.wall_clock.session import SupervisedSession

WAKES_PER_PERIOD = 32
"""How often channels are read between two ticks; a flood waits in its own pipe."""
SHORTEST_PERIOD = 0.91
"""After a late tick the next one comes early, and not so early that it is refused (`pace`)."""

Clock = Callable[[], float]


class Loop:
    """Ticks of one session.

    Args:
        session: What is ticked.
        rows: Rows of the replay, one a period.
        answers: From the policy.
        asks: To the policy.
        operator: From a person.
        admission: Judges answers.
        clock: Monotonic, s.

    Attributes:
        ticks: So far.
        missed: Rows of the replay that went by without a tick.
        throttled: Periods in which more came than is read in one.
    """

    def __init__(
        self,
        session: SupervisedSession,
        *,
        rows: int,
        answers: Inbox,
        asks: Outbox,
        operator: Inbox,
        admission: AdmissionThread,
        clock: Clock,
    ) -> None:
        self.session, self.ticks, self.missed, self.throttled = session, 0, 0, 0
        self._rows, self._answers, self._asks = rows, answers, asks
        self._operator, self._admission, self._clock = operator, admission, clock
        self._period_s = session.cell.horizons.action_period_s
        self._begin_s = clock()
        self._last_s = -math.inf
        self._believed = True
        self._silent = 0

    def run(self) -> None:
        """Tick until the replay is over, a person wants the end, or nobody could want it."""
        row, due_s, failed = 0, 0.0, ""
        while row < self._rows and not self.session.ended and not self._operator.closed:
            self._wait(due_s)
            now_s = self._now()
            if 0 <= now_s - self._last_s <= LONGEST_JUMP_NS / NS_PER_S:
                late = math.floor(now_s / self._period_s) - row
                self.missed += max(late, 0)
                row += max(late, 0)
            if row >= self._rows:
                break
            self._tick(now_s, row)
            if self._believed:
                self.session.tally.late_s.append(now_s - due_s)
            failed = self._watch(now_s, failed)
            row += 1
            due_s = max(row * self._period_s, now_s + SHORTEST_PERIOD * self._period_s)
        if self._operator.closed:
            self.session.fail(self._now(), "the operator's channel is closed")

    def _tick(self, now_s: float, row: int) -> None:
        """A clock that stands still tells no time."""
        told_s = now_s if now_s != self._last_s else math.nan
        ask = self.session.tick(told_s, row)
        self._believed = not self.session.journal.doubt
        self._silent = 0 if self._believed else self._silent + 1
        self._last_s = max(now_s, self._last_s) if self._believed else self._last_s
        if ask is not None and not self._asks.send(ask.encoded()):
            self.session.tally.dropped["ask_not_sent"] += 1
        self._asks.flush()
        self.session.journal.flush()
        self.ticks += 1

    def _watch(self, now_s: float, before: str) -> str:
        """E-stop once each time that the clock or the journal is lost. Returns for what."""
        silence_s = self.session.cell.execution.silence_stop_s or math.inf
        cause = ""
        if self._silent * self._period_s >= silence_s:
            cause = "no clock"
        elif self.session.journal.lost:
            cause = f"no journal: {self.session.journal.lost}"
        if cause and cause != before:
            self.session.fail(now_s, cause)
        return cause

    def _now(self) -> float:
        return self._clock() - self._begin_s

    def _wait(self, due_s: float) -> None:
        """Hear the person, however late it is; serve whoever says something until the next tick."""
        self._heed()
        if not self._believed:
            time.sleep(self._period_s)
            self._serve()
            return
        for _ in range(WAKES_PER_PERIOD):
            left_s = self._left_s(due_s)
            if not left_s > 0:
                return
            ready = select.select(self._open(), [], [], left_s)[0]
            if not ready:
                return
            self._serve()
        self.throttled += 1
        time.sleep(self._left_s(due_s))

    def _left_s(self, due_s: float) -> float:
        """Until the next tick, never more than a period, s."""
        return min(max(due_s - self._now(), 0.0), self._period_s)

    def _open(self) -> list[int]:
        inboxes = [inbox for inbox in (self._answers, self._operator) if not inbox.closed]
        return [self._admission.descriptor, *(inbox.descriptor for inbox in inboxes)]

    def _heed(self) -> None:
        """Obey the person; where every tick is late there is no other time to.

        A clock that stood at the last tick and has not gone on tells the person no time either.
        """
        session, now_s = self.session, self._now()
        if now_s == self._last_s and not self._believed:
            now_s = math.nan
        for payload in self._operator.read():
            operator = read_operator(payload)
            if operator is None:
                session.tally.dropped["operator_malformed"] += 1
            else:
                session.obey(operator, now_s)

    def _serve(self) -> None:
        """Read what there is; the person first."""
        self._heed()
        session, now_s, judges = self.session, self._now(), self._admission
        for payload in self._answers.read():
            answer = read_answer(payload)
            if answer is None:
                session.tally.dropped["malformed"] += 1
            else:
                session.answer(answer, now_s, judges.submit, judging_s=judges.usual_s)
        judged = judges.result()
        if judged is not None:
            session.decide(*judged, self._now(), judges.submit, judging_s=judges.usual_s)
