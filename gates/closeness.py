"""How near a criterion's number is to its limit: the share of the limit that is used up."""

from dataclasses import dataclass

from gates.report import Answer

NEAR = 0.9
"""From this share of its limit on a criterion that holds is called near it: another draw of the
same evidence moves most numbers by a tenth."""


@dataclass(frozen=True)
class Closeness:
    """A criterion that holds, and how much room it has.

    Attributes:
        answer: The criterion.
        used: Share of the limit that is used up, 0 to 1; 1 is at the limit.
        worse_end: Whether it was judged at the worse end of an interval, not at a point.
    """

    answer: Answer
    used: float
    worse_end: bool

    @property
    def near(self) -> bool:
        """Whether another draw might break it."""
        return self.used >= NEAR


def closeness(answer: Answer) -> Closeness | None:
    """How close a criterion came; None where no share of a limit can be said.

    `<=`: measured / limit. `>=`: limit / measured. A limit of none (`<= 0`) or of all (`>= 1` of a
    number that is 1) is kept or broken: nothing lies near it.

    Args:
        answer: The criterion.
    """
    limit, found = answer.threshold, answer.measured
    if answer.verdict != "PASS" or limit is None or found is None or not limit > 0:
        return None
    if answer.comparison == ">=" and limit == found == 1:
        return None
    used = limit / found if answer.comparison == ">=" else max(found, 0.0) / limit
    end = 1 if answer.comparison == "<=" else 0
    return Closeness(answer, used, answer.interval is not None and found == answer.interval[end])


def by_room(answers: list[Answer]) -> list[Closeness]:
    """Those of which it can be said, the nearest to its limit first; equals in their order."""
    found = [near for answer in answers if (near := closeness(answer)) is not None]
    return sorted(found, key=lambda near: -near.used)
