"""What a journal says of each entry into recovery: the rows of `recoveries.parquet`, derived again.

Shares no code with what wrote them. The events of one entry are kept, from the one that begins it
to the next one that does, and the columns are read off them.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.verification.journal_source import Message, floats

KEYS = ("method", "perturbation", "start", "recovery")
"""Columns by which an entry is known."""
HANDED_BACK = "handed_back"
ENDS = {"idle": HANDED_BACK, "ask_human": "person", "stopped": "stopped"}
"""How an entry ended, by the state that it went to; an abort has words of its own."""
NO_PRIMITIVES = ("idle", "hold", "ask_human", "person", "abort", "stopped")
"""States that move nothing by themselves; every other one is a primitive."""
COMMANDS = ("accept", "fallback")
MOTION_M, MOTION_TURN = 0.001, 0.01
"""Less than a millimetre, or half a degree, is the pose that was held."""
Event = tuple[str, Message]


@dataclass
class _Entry:
    """One entry: the command that was held when it began, and every event from there on.

    Attributes:
        held: The action that was commanded last; empty where there was none.
        failed: Failed primitives of the rollout before it.
        first: The event that begins it.
        meanwhile: Events up to its end, that one included.
        afterwards: Those behind it.
        ended: How it ended; empty while it runs.
    """

    held: str
    failed: int
    first: Message
    meanwhile: list[Event] = field(default_factory=list)
    afterwards: list[Event] = field(default_factory=list)
    ended: str = ""

    def take(self, kind: str, m: Message) -> None:
        """Another event of the session."""
        if self.ended:
            self.afterwards.append((kind, m))
            return
        self.meanwhile.append((kind, m))
        if kind == "recovery":
            if m["new"] == "abort":
                self.ended = "timed_out" if m["cause"] == "timeout" else "refused"
            else:
                self.ended = ENDS.get(m["new"], "")
        elif kind == "end":
            self.ended = "episode_over"

    def columns(self) -> dict[str, Any]:
        """What it says by itself; times in s, force in N."""
        states = [m for kind, m in self.meanwhile if kind == "recovery"]
        primitives = [m["new"] for m in states if m["new"] not in NO_PRIMITIVES]
        forces_n = [m["force_n"] for kind, m in self.meanwhile if kind == "recovery_force"]
        driven = [floats(action) for action in self._driven()]
        before = floats(self.held) if self.held else next(iter(driven), None)
        still = before is None or not any(_apart(before, action) for action in driven)
        last_ns = self.meanwhile[-1][1]["t"] if self.meanwhile else self.first["t"]
        return {
            "phase": self.first["phase"],
            "cause": self.first["cause"],
            "primitives": " ".join(primitives),
            "failures": (states[-1]["failures"] if states else self.failed) - self.failed,
            "ended": self.ended,
            "resampled_only": self.ended == HANDED_BACK and still,
            "taken_over": self.ended == HANDED_BACK
            and any(kind == "accept" for kind, _ in self.afterwards),
            "duration_s": (last_ns - self.first["t"]) / 1e9,
            "force_peak_n": max(forces_n, default=0.0),
            "resets": int(self.ended == "stopped"),
        }

    def _driven(self) -> Iterator[str]:
        """The actions that its primitives commanded: of the fallback, from the first of them on."""
        driving = False
        for kind, m in self.meanwhile:
            driving |= kind == "recovery" and m["new"] not in NO_PRIMITIVES
            if driving and kind == "fallback":
                yield m["action"]


def _apart(before: NDArray[np.float64], action: NDArray[np.float64]) -> bool:
    """Whether a command asks for a motion: of the hand, of its turn, or of its fingers."""
    away = np.abs(action - before)
    way_m, turn = np.linalg.norm(away[:3]), np.linalg.norm(away[3:9])
    return bool(max(way_m, away[9]) >= MOTION_M or turn >= MOTION_TURN)


class Recoveries:
    """Takes the events of one session in."""

    def __init__(self) -> None:
        self._entries: list[_Entry] = []
        self._held = ""
        self._failed = 0

    def read(self, kind: str, m: Message) -> None:
        """Take an event in."""
        begins = kind == "recovery" and m["old"] == "idle" and m["new"] == "hold"
        if begins:
            self._entries.append(_Entry(self._held, self._failed, m))
        elif self._entries and kind in ("recovery", "recovery_force", "end", *COMMANDS):
            self._entries[-1].take(kind, m)
        if kind in COMMANDS:
            self._held = m["action"]
        elif kind == "recovery":
            self._failed = m["failures"]

    def rows(self, *, succeeded: bool) -> Iterator[dict[str, Any]]:
        """Columns of each entry but method, condition, start and seed, in the order of entry.

        Args:
            succeeded: Whether the rollout ended in success.
        """
        phases = [str(entry.first["phase"]) for entry in self._entries]
        for number, entry in enumerate(self._entries):
            own = entry.columns()
            helped = own["taken_over"] and not own["resampled_only"]
            yield {
                "recovery": number,
                **own,
                "succeeded": succeeded,
                "recovered": helped and succeeded and phases[number] not in phases[number + 1 :],
            }
