"""When each exposure had to be, and to arrive, drawn again, and whether a journal states that."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from genpolicy.verification.journal_source import Message

LATE, LOST = "camera_delay", "frame_drop"
"""Kinds that hit exposures: one comes later by `magnitude_s`, or never."""
SENSED = ("exposure", "capture", "decode", "transfer")
"""The terms of an exposure, in the order in which they are drawn."""
SLOWER = "capture"
"""Which of these a late camera takes longer for."""
ROUNDING_NS = 2.0


def sensed_s(
    planned: Mapping[str, Any],
    declared: Mapping[str, tuple[float, float]],
    lots: Sequence[float],
) -> dict[str, float]:
    """What each sensor term of an exposure takes, s; infinite where it never comes.

    Args:
        planned: The perturbation: `kind` and its fields.
        declared: Least and most of each declared term, s.
        lots: Draws in [0, 1): one a term, whether it is hit, and one that no kind needs.
    """
    found = {}
    for term, lot in zip(SENSED, lots[: len(SENSED)], strict=True):
        least_s, most_s = declared[term]
        found[term] = least_s + (most_s - least_s) * lot
    if planned["kind"] in (LATE, LOST) and lots[len(SENSED)] < planned["probability"]:
        found[SLOWER] += math.inf if planned["kind"] == LOST else planned["magnitude_s"]
    return found


@dataclass
class Sensed:
    """The exposures of one rollout while its events go by.

    Attributes:
        condition: Name of its perturbation.
        start: Its initial state.
        period_ns: Between two exposures.
    """

    condition: str
    start: int
    period_ns: int
    _exposed_ns: list[int] = field(default_factory=list)
    _there_ns: dict[int, int] = field(default_factory=dict)

    def read(self, kind: str, m: Message) -> None:
        """Take an `exposure` or an `arrived` in."""
        if kind == "exposure":
            self._exposed_ns.append(m["t"])
        else:
            self._there_ns[m["exposed_ns"]] = m["t"]

    @property
    def newest(self) -> tuple[int, int]:
        """The newest that has arrived: its number, and when it was exposed, ns; -1 of none."""
        newest_ns = max(self._there_ns, default=None)
        return (-1, -1) if newest_ns is None else (self._exposed_ns.index(newest_ns), newest_ns)

    def otherwise(
        self, end_ns: int, takes_s: Callable[[str, int, int], Mapping[str, float]]
    ) -> Iterator[str]:
        """What was not exposed, or did not arrive, when it had to, in words.

        Args:
            end_ns: When the rollout ended.
            takes_s: Sensor terms by condition, start and number of the exposure, s.
        """
        if len(self._exposed_ns) < round(end_ns / self.period_ns):
            yield f"{len(self._exposed_ns)} exposures until {end_ns} ns, one a period was to be"
        for number, exposed_ns in enumerate(self._exposed_ns):
            # The period is told in whole ns, and a number may be any.
            if not abs(exposed_ns - number * self.period_ns) <= ROUNDING_NS + number / 2:
                yield f"exposure {number} is at {exposed_ns} ns, and was to be one a period"
            own_s = sum(takes_s(self.condition, self.start, number).values())
            due_ns, came_ns = exposed_ns + own_s * 1e9, self._there_ns.get(exposed_ns)
            if came_ns is None:
                if due_ns + self.period_ns < end_ns:
                    yield f"exposure {number} never came, and was to at {due_ns:.0f} ns"
            elif not abs(came_ns - due_ns) <= ROUNDING_NS:
                yield f"exposure {number} came at {came_ns} ns, and was to at {due_ns:.0f} ns"
