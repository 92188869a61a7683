"""How much more of the same evidence would decide, where a limit lies inside an interval.

A half width shrinks with the square root of the number of independent units. So what lies between
the share that was seen and the limit says how many times as many units bring the interval's end
to the limit, if they show the same share. It is a plan and no verdict: nothing is judged by it,
and a share that stays where it is lies on one side of the limit only if it lies there in truth.
"""

import math
from collections.abc import Iterable

from gates.criterion import Measured
from gates.report import Answer, Comparison
from gates.verdicts import margin

INSIDE = "the limit lies inside the interval"
"""Said of what is neither shown to hold nor shown to be broken."""
ASTRIDE = f"{INSIDE}: more of the same evidence decides"

MOST = 10.0
"""Times as many, from which on nobody would collect them for this question."""
HARDLY = f"so near that {MOST:g} times as many"
"""Said where more of the same may not decide."""
LEAST = 1.1
"""Times as many that are ever said: an end on the limit itself is moved by a few more."""


def times_as_many(point: float, interval: tuple[float, float], limit: float) -> float:
    """How many times as many independent units bring the end that faces the limit to it.

    Args:
        point: The share that was seen.
        interval: Its interval, lower end first, with the limit inside.
        limit: What is asked.

    Returns:
        At least 1; infinity where the share lies on the limit itself.
    """
    gap = abs(limit - point)
    half = interval[1] - point if limit > point else point - interval[0]
    return math.inf if gap == 0.0 else max(1.0, (half / gap) ** 2)


def enough(
    point: float,
    interval: tuple[float, float],
    limit: float,
    comparison: Comparison,
    *,
    counted: str,
) -> str:
    """What would decide, in words without a semicolon.

    Args:
        point: The share that was seen.
        interval: Its interval.
        limit: What is asked.
        comparison: How the number must stand to it.
        counted: The independent units it rests on now.
    """
    times = times_as_many(point, interval, limit)
    if not times <= MOST:
        return f"{HARDLY} ({counted} now) may not decide"
    # Rounded up: fewer than this would leave the limit inside.
    shown = max(math.ceil(10.0 * times) / 10.0, LEAST)
    holds = "holds" if margin(point, limit, comparison) >= 0 else "is broken"
    return (
        f"about {shown:g} times as many ({counted} now) show that it {holds}, if they say the same"
    )


def astride(measured: Measured, limit: float, comparison: Comparison) -> str:
    """What would decide a criterion whose limit lies inside its interval, without a semicolon."""
    point, ends = measured.point, measured.interval
    if point is None or ends is None or not all(map(math.isfinite, (point, *ends))):
        return ASTRIDE
    return f"{INSIDE}: {enough(point, ends, limit, comparison, counted=measured.counted)}"


def hardly_decided(caveat: str) -> bool:
    """Whether the sentence of a criterion says that more of the same may not decide it."""
    return HARDLY in caveat


def no_decision(answers: Iterable[Answer]) -> str:
    """What an undecided gate says: whether completing the evidence is of any use."""
    open_ = [answer.caveat for answer in answers if answer.verdict == "INCONCLUSIVE"]
    if open_ and all(map(hardly_decided, open_)):
        return "No decision: what is open lies so near its limit that more of it may not decide."
    return "No decision: complete the evidence, then judge again."
