"""What a journal says of the windows of one clock: invocations, ages, ticks; from raw events."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from genpolicy.verification.journal_source import Message, read_messages

GAVE_WAY = "superseded"
"""Reason by which the rest of a chunk ends because another one takes over; a reset is none."""
NS_PER_S = 1e9


@dataclass(frozen=True)
class Windows:
    """Rows of a journal, as columns by name.

    Attributes:
        invocations: `ClockInvocationRow`.
        ages: `ClockAgeRow`.
        ticks: `ClockTickRow`.
    """

    invocations: list[dict[str, Any]] = field(default_factory=list)
    ages: list[dict[str, Any]] = field(default_factory=list)
    ticks: list[dict[str, Any]] = field(default_factory=list)


def derived_windows(paths: Iterable[Path], *, deadline_s: float) -> Windows:
    """Rows of every window of journal files named `METHOD__CLOCK.mcap`.

    Args:
        paths: The files.
        deadline_s: Deadline of an invocation.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal, or an event that cannot be read.
    """
    found = Windows()
    for path in sorted(paths):
        clock = path.stem.rpartition("__")[2]
        sessions: dict[str, _Window] = {}
        for kind, message in read_messages(path):
            sessions.setdefault(str(message["session"]), _Window()).read(kind, message)
        for window in sessions.values():
            window.tell(found, clock=clock, deadline_ns=round(deadline_s * NS_PER_S))
    return found


@dataclass
class _Invocation:
    number: int
    begun_ns: int
    missed: bool = False
    discarded_by: str = ""
    replaced: bool = False


@dataclass
class _Window:
    """One session while its events go by."""

    labels: dict[str, str] = field(default_factory=dict)
    period_ns: int = 0
    end_ns: int = 0
    seen_ns: set[int] = field(default_factory=set)
    invocations: dict[str, _Invocation] = field(default_factory=dict)
    accepted: list[tuple[str, int, int]] = field(default_factory=list)

    def read(self, kind: str, m: Message) -> None:
        """Take an event in."""
        if kind == "session":
            self.labels, self.period_ns = m["labels"], m["period_ns"]
        elif kind == "observation":
            self.seen_ns.add(m["t"])
        elif kind == "invocation":
            self._invocation(m)
        elif kind == "accept":
            self.accepted.append((m["chunk_id"], m["row"], m["age_ns"]))
        elif kind in ("discard", "finish"):
            self._ended(m)
        elif kind == "end":
            self.end_ns = m["t"]

    def _invocation(self, m: Message) -> None:
        if m["stage"] == "begin":
            self.invocations[m["id"]] = _Invocation(len(self.invocations), m["t"])
        elif m["stage"] == "end" and m["detail"] == "deadline":
            self.invocations[m["id"]].missed = True

    def _ended(self, m: Message) -> None:
        """A chunk of which nothing was executed was discarded; the rest of another may give way."""
        of = self.invocations[m["chunk_id"]]
        reason = str(m.get("reason", "expired"))
        if m["ended"] == "discarded":
            of.discarded_by = reason
        else:
            of.replaced = reason == GAVE_WAY

    def tell(self, found: Windows, *, clock: str, deadline_ns: int) -> None:
        """Add the rows of this window."""
        key = {"method": self.labels["method"], "clock": clock, "episode": self.labels["episode"]}
        for of in self.invocations.values():
            found.invocations.append(
                {
                    **key, "invocation": of.number,
                    "in_time": of.begun_ns + deadline_ns + self.period_ns <= self.end_ns,
                    "missed": of.missed, "discarded_by": of.discarded_by, "replaced": of.replaced,
                }
            )  # fmt: skip
        for chunk_id, row, age_ns in self.accepted:
            number = self.invocations[chunk_id].number
            found.ages.append({**key, "invocation": number, "row": row, "age_s": age_ns / NS_PER_S})
        beside = sorted(abs(_beside_s(at_ns, self.period_ns)) for at_ns in self.seen_ns)
        if beside:
            level = math.ceil((len(beside) - 1) * 0.95)
            found.ticks.append(
                {**key, "ticks": len(beside), "late_p95_s": beside[level],
                 "late_max_s": beside[-1]}
            )  # fmt: skip


def _beside_s(at_ns: int, period_ns: int) -> float:
    """How far a moment lies from a whole period, s."""
    return ((at_ns + period_ns // 2) % period_ns - period_ns // 2) / NS_PER_S
