"""What the virtual clock owes: no candidate is judged before its time, and each further one costs.

An invocation states how long it takes, and each check of another candidate what that takes. An
answer that is judged sooner, or after fewer checks than candidates, would be faster on paper than
any policy is. Invocations that state no time (the shadow evaluation has no clock) are not asked.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from genpolicy.verification.journal_source import Message

Finding = tuple[str, str]
ROUNDING_NS = 1_000
"""Sums of seconds are rounded to nanoseconds of a tick."""


@dataclass
class _Invocation:
    """One that is under way: when it began, what it has cost so far, and what was judged of it."""

    begun_ns: int
    cost_s: float
    checks: int = 0
    judged: int = 0

    def due_ns(self) -> float:
        return self.begun_ns + self.cost_s * 1e9 - ROUNDING_NS


class Invocations:
    """Follows the invocations of one session."""

    def __init__(self) -> None:
        self._of: dict[str, _Invocation] = {}

    def follow(self, kind: str, m: Message) -> Iterator[Finding]:
        """Take an event in; yields what it could not have cost so little."""
        if kind == "invocation" and m["stage"] == "begin" and m["detail"] != "":
            own = self._of[m["id"]] = _Invocation(m["t"], float(m["detail"]))
            if not own.cost_s > 0.0:
                yield "clock.latency", f"Invocation {m['id']!r} takes {own.cost_s} s."
        elif kind == "invocation" and m["stage"] == "check":
            if m["id"] not in self._of:
                yield "clock.check", f"A candidate of {m['id']!r} is checked before it began."
                return
            own = self._of[m["id"]]
            cost_s = float(m["detail"])
            if not cost_s > 0.0:
                yield "clock.check", f"The check of a candidate of {m['id']!r} takes {cost_s} s."
            own.checks, own.cost_s = own.checks + 1, own.cost_s + cost_s
        elif kind == "candidate" and m["chunk_id"] in self._of:
            own = self._of[m["chunk_id"]]
            which = f"Candidate {m['index']} of {m['chunk_id']!r}"
            if m["index"] != own.judged:
                yield "clock.order", f"{which} is judged, {own.judged} were judged before it."
            if m["index"] != own.checks:
                yield "clock.check", f"{which} is judged after {own.checks} further checks."
            own.judged += 1
            yield from self._early(which, own, m)
        elif kind == "enqueue" and m["chunk_id"] in self._of:
            yield from self._early(repr(m["chunk_id"]), self._of[m["chunk_id"]], m)

    @staticmethod
    def _early(which: str, own: _Invocation, m: Message) -> Iterator[Finding]:
        if not m["t"] >= own.due_ns():
            yield (
                "clock.early",
                f"{which} comes at {m['t']} ns and is due at {own.due_ns():.0f} ns.",
            )
