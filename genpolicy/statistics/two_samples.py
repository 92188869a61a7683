"""Do two ways of doing the same units differ by less than a tolerance? Intervals over the units.

A unit (an episode) is done once each way, so units are drawn again in pairs. Equivalence is shown
where the whole interval lies within the tolerance (Schuirmann 1987; Westlake 1981), never by a
difference that was not found. Neither interval is narrower than what so many units of which none
differs cannot exclude. Sources: as `clustered`; Newcombe 1998, method 10, for two shares.
"""

import math

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError
from genpolicy.statistics import clustered
from genpolicy.statistics.intervals import clopper_pearson

Array = NDArray[np.float64]


def distance_interval(
    first: Array, second: Array, *, confidence: float, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Kolmogorov-Smirnov distance of two pooled distributions, with its interval over units.

    Args:
        first: Counts of each ordered value in each unit, one way. Shape (n, values).
        second: The other way. Shape (n, values).
        confidence: Nominal coverage.
        rng: Generator of the draws.

    Returns:
        Distance, lower and upper end. The upper end is at least the share of units that may
        differ where none of n did.

    Raises:
        ContractError: No units, or none with a value on a side.
    """
    n = len(first)
    if n == 0 or first.shape != second.shape or min(first.sum(), second.sum()) <= 0:
        raise ContractError(
            where="a distance of two distributions",
            found=f"{first.sum():g} and {second.sum():g} values in {n} units",
            expected="values on both sides, of the same units",
            action="Run both ways on the same units.",
        )
    counts = _drawn(n, rng)
    drawn = _distances(counts @ first, counts @ second)
    point = float(_distances(first.sum(axis=0)[None], second.sum(axis=0)[None])[0])
    tail = (1.0 - confidence) / 2.0
    lower, upper = np.nanquantile(drawn, [tail, 1.0 - tail])
    unseen = clopper_pearson(0, n, confidence)[1]
    return point, min(point, float(lower)), max(point, float(upper), unseen)


def share_difference(
    first: tuple[Array, Array],
    second: tuple[Array, Array],
    *,
    confidence: float,
    rng: np.random.Generator,
) -> tuple[float, float, float]:
    """Difference of two shares, the first less the second, with its interval over units.

    The wider, at either end, of units drawn again in pairs and of what the two shares' own
    intervals, which are never narrower than exact ones of so many units, allow.

    Args:
        first: Hits of each unit, and of how many, one way. Shape (n,) each; a unit may have none.
        second: The other way.
        confidence: Nominal coverage.
        rng: Generator of the draws.

    Raises:
        ContractError: No units with anything to count on a side.
    """
    n = len(first[0])
    counts = _drawn(n, rng) if n else np.zeros((0, 0))
    ends, shares = [], []
    for hits, whole in (first, second):
        some = whole > 0
        ends.append(
            clustered.ratio_interval(hits[some], whole[some], confidence=confidence, rng=rng)
        )
        shares.append(float(hits.sum() / whole.sum()))
    with np.errstate(invalid="ignore", divide="ignore"):
        drawn = (counts @ first[0]) / (counts @ first[1]) - (counts @ second[0]) / (
            counts @ second[1]
        )
    tail = (1.0 - confidence) / 2.0
    low, high = np.nanquantile(drawn, [tail, 1.0 - tail])
    (p_low, p_high), (q_low, q_high) = ends
    p, q = shares
    wide_low = p - q - math.hypot(p - min(p, p_low), max(q, q_high) - q)
    wide_high = p - q + math.hypot(max(p, p_high) - p, q - min(q, q_low))
    return p - q, min(float(low), wide_low), max(float(high), wide_high)


def _drawn(n: int, rng: np.random.Generator) -> Array:
    """How often each unit is drawn. Shape (draws, n)."""
    return rng.multinomial(n, np.full(n, 1.0 / n), size=clustered.DRAWS).astype(np.float64)


def _distances(first: Array, second: Array) -> Array:
    """Of rows of counts; NaN where one side has none. Shape (draws,)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        a = np.cumsum(first, axis=1) / first.sum(axis=1, keepdims=True)
        b = np.cumsum(second, axis=1) / second.sum(axis=1, keepdims=True)
    return np.asarray(np.abs(a - b).max(axis=1))
