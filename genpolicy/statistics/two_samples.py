"""Do two ways of doing the same units differ by less than a tolerance? Intervals over the units.

A unit (an episode) is done once each way, so units are drawn again in pairs. Equivalence is shown
where the whole interval lies within the tolerance (Schuirmann 1987; Westlake 1981), never by a
difference that was not found. No interval is narrower than what so many units of which none
differs cannot exclude, and fewer units than `clustered.MINIMUM_CLUSTERS` tell nothing.
"""

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
    point = float(_distances(first.sum(axis=0)[None], second.sum(axis=0)[None])[0])
    if n < clustered.MINIMUM_CLUSTERS:
        return point, 0.0, 1.0
    counts = _drawn(n, rng)
    drawn = _distances(counts @ first, counts @ second)
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

    Neither end lies nearer to the difference than the share of units that may do otherwise where
    none of n did.

    Args:
        first: Hits of each unit, and of how many, one way. Shape (n,) each; a unit may have none.
        second: The other way.
        confidence: Nominal coverage.
        rng: Generator of the draws.

    Raises:
        ContractError: No units with anything to count on a side.
    """
    n = len(first[0])
    if n == 0 or not min(first[1].sum(), second[1].sum()) > 0:
        raise ContractError(
            where="a difference of two shares",
            found=f"{first[1].sum():g} and {second[1].sum():g} cases in {n} units",
            expected="cases on both sides, of the same units",
            action="Run both ways on the same units.",
        )
    point = float(first[0].sum() / first[1].sum() - second[0].sum() / second[1].sum())
    if n < clustered.MINIMUM_CLUSTERS:
        return point, -1.0, 1.0
    counts = _drawn(n, rng)
    with np.errstate(invalid="ignore", divide="ignore"):
        one = (counts @ first[0]) / (counts @ first[1])
        other = (counts @ second[0]) / (counts @ second[1])
    tail = (1.0 - confidence) / 2.0
    low, high = np.nanquantile(one - other, [tail, 1.0 - tail])
    unseen = clopper_pearson(0, n, confidence)[1]
    return point, min(float(low), point - unseen), max(float(high), point + unseen)


def _drawn(n: int, rng: np.random.Generator) -> Array:
    """How often each unit is drawn. Shape (draws, n)."""
    return rng.multinomial(n, np.full(n, 1.0 / n), size=clustered.DRAWS).astype(np.float64)


def _distances(first: Array, second: Array) -> Array:
    """Of rows of counts; NaN where one side has none. Shape (draws,)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        a = np.cumsum(first, axis=1) / first.sum(axis=1, keepdims=True)
        b = np.cumsum(second, axis=1) / second.sum(axis=1, keepdims=True)
    return np.asarray(np.abs(a - b).max(axis=1))
