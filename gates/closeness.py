"""How near a criterion's number is to its limit: the share of its room that is used up.

Room lies between the best that a number could be and the limit, and is used up from the best on:

- at most: from 0; a ratio from 1, at which nothing changed;
- at least, of a share: from 1 down, so that 99.7 % where 90 % are asked uses 3 % of the room;
- at least, of a count: it has no best, so `limit / measured`; evidence multiplies, so the
  logarithms of both.

What does not hold has no room: its bar is full.
"""

import math
from dataclasses import dataclass

from gates.readable import EVIDENCE, RATIO
from gates.report import Answer
from gates.words import percent

NEAR = 0.9
"""Share of the room from which on little is left, whatever chance does."""
BY_CHANCE = "what is left is less than half of its interval, so that another draw may break it"
"""Said of what is near by its interval."""


@dataclass(frozen=True)
class Closeness:
    """A criterion with a number and a limit, and how much of its room is used up.

    Attributes:
        answer: The criterion.
        used: Share of the room that is used up, 0 to 1; 1 at the limit, and where it does not hold.
        worse_end: Whether it was judged at the worse end of an interval, not at a point.
    """

    answer: Answer
    used: float
    worse_end: bool

    @property
    def holds(self) -> bool:
        """Whether it is shown to hold."""
        return self.answer.verdict == "PASS"

    @property
    def chance(self) -> bool:
        """Whether another draw of as many units may break what holds.

        To the limit it is less than half of the interval. The end of another draw's interval lies
        about that far from this one in about one of ten draws.
        """
        answer = self.answer
        if not self.holds or answer.interval is None:
            return False
        left = abs((answer.threshold or 0.0) - (answer.measured or 0.0))
        return left < (answer.interval[1] - answer.interval[0]) / 2.0

    @property
    def said(self) -> str:
        """How much of its room is used up, in words."""
        return f"{percent(self.used)} of its room to the limit is used up"

    @property
    def near(self) -> bool:
        """Whether it holds with next to no room: by the number alone, or by its interval."""
        return self.holds and (self.used >= NEAR or self.chance)


def closeness(answer: Answer) -> Closeness | None:
    """How close a criterion came; None where there is no number, no limit, or no room to speak of.

    A limit of none (`<= 0`) or of all (`>= 1` of a number that is 1) is kept or broken: nothing
    lies near it. Broken, it has a full bar like everything that does not hold.

    Args:
        answer: The criterion.
    """
    limit, found = answer.threshold, answer.measured
    if limit is None or found is None or answer.verdict == "PENDING_REVIEW":
        return None
    end = 1 if answer.comparison == "<=" else 0
    worse_end = answer.interval is not None and found == answer.interval[end]
    if answer.verdict != "PASS":
        return Closeness(answer, 1.0, worse_end)
    if limit <= 0 or (answer.comparison == ">=" and limit == found == 1):
        return None
    return Closeness(answer, min(1.0, max(0.0, _used(answer.id, found, limit, end))), worse_end)


def _used(name: str, found: float, limit: float, end: int) -> float:
    """Share of the room that is used up, of what holds; below 0 where it is better than the best.

    Args:
        name: Of the criterion.
        found: What was measured.
        limit: The limit, above 0.
        end: 1 where at most the limit is asked, 0 where at least.
    """
    if end:
        best = 1.0 if RATIO in name and limit > 1 else 0.0
        return (found - best) / (limit - best)
    if limit < 1:
        return (1.0 - found) / (1.0 - limit)
    if name.endswith(EVIDENCE) and limit > 1:
        return math.log(limit) / math.log(found)
    return limit / found


def by_room(answers: list[Answer]) -> list[Closeness]:
    """Those of which it can be said: what is broken, what is not decided, then the nearest first.

    Equals stay in their order.
    """
    found = [near for answer in answers if (near := closeness(answer)) is not None]
    return sorted(found, key=first_what_does_not_hold)


def first_what_does_not_hold(near: Closeness) -> tuple[bool, bool, float]:
    """By this a reader finds first what is broken, then what is not decided, then the nearest."""
    return near.holds, near.answer.verdict != "FAIL", -near.used
