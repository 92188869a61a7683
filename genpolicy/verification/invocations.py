"""What the virtual clock owes: no candidate is judged before its time, and each further one costs.

An invocation states how long it takes, and each check of another candidate what that takes. An
answer that is judged sooner than stated, or after fewer checks than candidates, would be faster on
paper than any policy is. One that has not come when its deadline is over is given up at that tick:
called answered, it would be a miss that nobody counts. That the stated times are those of the
latency model is not asked here.
A policy in a process of its own that failed has no answer: its kind of fault is of a closed list,
the deadline is missed with it, and nothing of it is judged.
A session of a rollout (its labels name the start) has a clock, and states every time; one of the
shadow evaluation has none, and there nothing is asked.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from genpolicy.verification.arrived import TIMED, Arrived
from genpolicy.verification.expected import ExpectedSettings
from genpolicy.verification.journal_source import Message
from genpolicy.verification.terms import Terms

Finding = tuple[str, str]
ROUNDING_NS = 1_000
"""Sums of seconds are rounded to nanoseconds of a tick."""
TICK_ROUNDING_NS = 2
"""A time of a tick is rounded to ns, and so is that of an exposure."""
UNCHECKED = "reject_candidate"
"""What a journal calls a candidate that was refused because its check took too long."""
GOES_ON = "continue"
FAULTS = (
    "late", "closed", "refused", "oversize", "malformed", "shape", "unrequested", "changed",
    "nonfinite", "gone",
)  # fmt: skip
"""How a policy in a process of its own can fail."""
DEADLINE, ANSWERED = "deadline", "answered"
MISSED = (DEADLINE, "overrun")
"""How an invocation ends that was not answered in time."""


@dataclass
class _Invocation:
    """One that is under way: what it saw, what it has cost since, and what was judged of it."""

    begun_ns: int
    exposed_ns: int
    cost_s: float
    checks: int = 0
    judged: int = 0
    answered: bool = False
    over: bool = False
    ended: bool = False
    failed: bool = False

    def due_ns(self) -> float:
        return self.exposed_ns + self.cost_s * 1e9 - ROUNDING_NS


class Invocations:
    """Follows the invocations of one session.

    Args:
        expected: Whose deadline they are held to; None: to none.
    """

    def __init__(self, expected: ExpectedSettings | None = None) -> None:
        self._expected = expected
        self._of: dict[str, _Invocation] = {}
        self._arrived = Arrived()
        self._terms = Terms()
        self._timed = False
        self._failing = ""
        self._open: dict[str, _Invocation] = {}
        self._tick_ns: int | None = None

    def follow(self, kind: str, m: Message) -> Iterator[Finding]:
        """Take an event in; yields what it could not have cost so little, or have seen."""
        yield from self._arrived.follow(kind, m)
        if kind == "session":
            self._timed = TIMED in m["labels"]
        elif not self._timed:
            return
        yield from self._terms.follow(kind, m)
        if kind == "observation":
            yield from self._tick(m["t"])
        elif kind == "invocation":
            yield from self._missed(m)
            yield from self._invocation(m)
        elif kind == "conditioning":
            if m["id"] in self._of:  # what it takes counts from what it saw
                self._of[m["id"]].exposed_ns = m["exposed_ns"]
        elif kind == "joined":
            if m["invocation"] in self._of:  # the chunk is an answer to it, whatever its own id
                self._of[m["chunk_id"]] = self._of[m["invocation"]]
        elif kind == "candidate":
            yield from self._candidate(m)
        elif kind == "enqueue" and m["source"] == "policy":
            yield from self._enqueued(m)
        elif kind == "end" and self._failing:
            yield "clock.fault", f"{self._failing!r} failed, and its deadline is not missed."

    def _enqueued(self, m: Message) -> Iterator[Finding]:
        own = self._of.get(m["chunk_id"])
        if own is None or own.judged == 0:
            yield "clock.unknown", f"{m['chunk_id']!r} comes, and nothing of it was judged."
        else:
            yield from self._early(repr(m["chunk_id"]), own, m)

    def _missed(self, m: Message) -> Iterator[Finding]:
        """A fault and the deadline that it costs stand side by side."""
        failing, self._failing = self._failing, ""
        ended = m["id"] == failing and m["stage"] == "end" and m["detail"] in MISSED
        if failing and not ended:
            yield "clock.fault", f"{failing!r} failed, and its deadline is not missed."

    def _invocation(self, m: Message) -> Iterator[Finding]:
        own = self._of.get(m["id"])
        if m["stage"] == "begin":
            if own is not None:
                yield "clock.begin", f"Invocation {m['id']!r} begins again."
                return
            own = _Invocation(m["t"], m["t"], float(m["detail"]))
            self._of[m["id"]] = self._open[m["id"]] = own
            if not own.cost_s > 0.0:
                yield "clock.latency", f"Invocation {m['id']!r} takes {own.cost_s} s."
        elif own is None:
            yield "clock.unknown", f"Invocation {m['id']!r} has a {m['stage']} and no begin."
        elif m["stage"] == "check":
            cost_s = float(m["detail"])
            if not cost_s > 0.0:
                yield "clock.check", f"The check of a candidate of {m['id']!r} takes {cost_s} s."
            own.checks, own.cost_s = own.checks + 1, own.cost_s + cost_s
        elif m["stage"] == "overrun":
            action = m["detail"].split()[-1]
            own.judged += action == UNCHECKED
            own.over |= action not in (UNCHECKED, GOES_ON)
        elif m["stage"] == "fault":
            if m["detail"] not in FAULTS:
                yield "clock.fault", f"{m['id']!r} failed by {m['detail']!r}, which is no fault."
            if own.failed or own.judged or own.answered:
                yield "clock.fault", f"{m['id']!r} failed, and had been judged or failed before."
            own.failed, self._failing = True, m["id"]
        else:
            yield from self._end(own, m)

    def _end(self, own: _Invocation, m: Message) -> Iterator[Finding]:
        own.answered |= m["detail"] == ANSWERED
        if own.failed and own.answered:
            yield "clock.fault", f"{m['id']!r} failed, and is answered."
        if m["detail"] not in (ANSWERED, *MISSED):
            yield "clock.end", f"{m['id']!r} ends as {m['detail']!r}, which is no end."
        if own.ended:
            yield "clock.end", f"{m['id']!r} ends again."
        own.ended = True
        self._open.pop(m["id"], None)
        early = self._expected is not None and not self._is_over(own, m["t"])
        if m["detail"] == DEADLINE and early:
            yield "clock.deadline", f"{m['id']!r} is given up, and its deadline is not over."

    def _tick(self, now_ns: int) -> Iterator[Finding]:
        """At the tick before this one whatever was over has been given up, or had come."""
        before_ns, self._tick_ns = self._tick_ns, now_ns
        if self._expected is None or before_ns is None:
            return
        for name, own in list(self._open.items()):
            # A term that takes too long ends it likewise, some of them at the tick behind.
            if not own.over and before_ns > own.begun_ns and self._is_over(own, before_ns):
                yield "clock.deadline", f"{name!r} was over at {before_ns} ns, and is not given up."
                del self._open[name]

    def _is_over(self, own: _Invocation, at_ns: int) -> bool:
        assert self._expected is not None  # who asks has a deadline
        most_ns = round(self._expected.deadline_s * 1e9) - TICK_ROUNDING_NS
        return at_ns - own.exposed_ns >= most_ns

    def _candidate(self, m: Message) -> Iterator[Finding]:
        which, own = f"Candidate {m['index']} of {m['chunk_id']!r}", self._of.get(m["chunk_id"])
        if own is None:
            yield "clock.unknown", f"{which} is judged, and its invocation never began."
            return
        if own.answered:
            yield "clock.order", f"{which} is judged after the answer."
        if own.failed:
            yield "clock.fault", f"{which} is judged, and its policy had failed."
        if own.over:
            yield "clock.overrun", f"{which} is judged, and a term of it had taken too long."
        if m["index"] != own.judged:
            yield "clock.order", f"{which} is judged, {own.judged} were judged before it."
        if m["index"] != own.checks:
            yield "clock.check", f"{which} is judged after {own.checks} further checks."
        own.judged += 1
        yield from self._early(which, own, m)

    @staticmethod
    def _early(which: str, own: _Invocation, m: Message) -> Iterator[Finding]:
        if not m["t"] >= own.due_ns():
            yield (
                "clock.early",
                f"{which} comes at {m['t']} ns and is due at {own.due_ns():.0f} ns.",
            )
