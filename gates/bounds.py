"""Bounds by which criteria are judged, where rows are not all independent.

Rows that share an episode, an observation or a start are one draw, not many. An exact bound of a
share is taken over the clusters: the share is that of the rows, the number of trials that of
the clusters, and the count is rounded to the unfavourable side.

One rule for every quantile (`upper_quantile`): it is judged at the worse end of its interval. What
the sample is too small to bound is not measured, so the criterion is INCONCLUSIVE; the point, which
may lie below the limit by luck, is never judged.
"""

import itertools
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gates.evidence import Array, MissingEvidenceError
from genpolicy.statistics.clustered import quantile_interval
from genpolicy.statistics.intervals import clopper_pearson


def share_interval(
    hits: Array | NDArray[np.bool_],
    clusters: NDArray[np.generic] | list[str],
    *,
    confidence: float,
    favourable: bool,
) -> tuple[float, float, float]:
    """Share of hits with an exact interval over clusters.

    Args:
        hits: Hit per row, in [0, 1]. Shape (n,).
        clusters: Cluster of each row. Shape (n,).
        confidence: Coverage of the interval.
        favourable: Whether a hit is good; decides to which side the count is rounded.

    Returns:
        Share, lower and upper bound.

    Raises:
        MissingEvidenceError: No rows.
    """
    if len(hits) == 0:
        raise MissingEvidenceError("no rows to take a share of")
    share = float(np.mean(np.asarray(hits, dtype=np.float64)))
    trials = len(set(np.asarray(clusters).tolist()))
    return (share, *interval_of(share, trials, confidence=confidence, favourable=favourable))


def interval_of(
    share: float, trials: int, *, confidence: float, favourable: bool
) -> tuple[float, float]:
    """Exact interval of a share that was counted over so many clusters; arguments as above."""
    product = round(share * trials, 9)
    successes = math.floor(product) if favourable else math.ceil(product)
    return clopper_pearson(successes, trials, confidence)


def wide_interval(
    hits: Array | NDArray[np.bool_],
    clusters: NDArray[np.generic] | list[str],
    *,
    confidence: float,
) -> tuple[float, float, float]:
    """As `share_interval`, the count rounded down for the lower bound and up for the upper one.

    For what is shown, or held against limits on both sides.
    """
    share, lower, _ = share_interval(hits, clusters, confidence=confidence, favourable=True)
    upper = share_interval(hits, clusters, confidence=confidence, favourable=False)[2]
    return share, lower, upper


def counted_interval(hits: float, trials: float, *, confidence: float) -> tuple[float, float]:
    """Exact interval of a share of independent trials.

    Raises:
        MissingEvidenceError: No trials, or counts that cannot be.
    """
    if trials <= 0 or not 0 <= hits <= trials:
        raise MissingEvidenceError(f"{hits:g} of {trials:g} is no share")
    return clopper_pearson(int(hits), int(trials), confidence)


def widest_gap(
    shares: Mapping[str, tuple[Array | NDArray[np.bool_], list[str]]], *, confidence: float
) -> tuple[tuple[float, float], str, str]:
    """Largest upper bound of a difference between the shares of two groups.

    Each share has its exact interval over clusters, rounded to both unfavourable sides; the ends
    of a difference lie as far out as the two ends, squared and added (Newcombe 1998, method 10).

    Args:
        shares: Hits and clusters of each group, at least two.
        confidence: Coverage of an interval.

    Returns:
        Interval of the widest difference, not below 0, and the groups with more and with less.

    Raises:
        MissingEvidenceError: A group without rows.
    """
    bounds = {
        name: wide_interval(hits, clusters, confidence=confidence)
        for name, (hits, clusters) in shares.items()
    }
    found = []
    for more, less in itertools.permutations(bounds, 2):
        (p, p_lower, p_upper), (q, q_lower, q_upper) = bounds[more], bounds[less]
        upper = p - q + math.hypot(p_upper - p, q - q_lower)
        lower = p - q - math.hypot(p - p_lower, q_upper - q)
        found.append((upper, max(lower, 0.0), more, less))
    upper, lower, more, less = max(found)
    return (lower, upper), more, less


def upper_quantile(
    values: Array,
    clusters: NDArray[np.generic] | list[str],
    quantile: float,
    *,
    confidence: float,
    rng: np.random.Generator,
) -> tuple[float, tuple[float, float]]:
    """Order statistic at or above a quantile, and the interval whose upper end is judged.

    Args:
        values: One per row. Shape (n,).
        clusters: Cluster of each row. Shape (n,).
        quantile: Which quantile, between 0 and 1.
        confidence: Coverage of the interval.
        rng: Draws clusters, where one holds several rows.

    Raises:
        MissingEvidenceError: No values, or too few to bound the quantile from both sides.
    """
    if len(values) == 0:
        raise MissingEvidenceError("no values to take a quantile of")
    point = float(np.quantile(values, quantile, method="higher"))
    lower, upper = quantile_interval(
        values, np.asarray(clusters), quantile, confidence=confidence, rng=rng
    )
    if not (math.isfinite(lower) and math.isfinite(upper)):
        trials = len(set(np.asarray(clusters).tolist()))
        raise MissingEvidenceError(
            f"{len(values)} values of {trials} independent draws bound no {quantile:.0%} quantile "
            f"at confidence {confidence:g}; {draws_for_quantile(quantile, confidence)} draws of "
            "one value each do"
        )
    return point, (lower, upper)


def mean_gain(differences: Array) -> float:
    """Mean of paired differences; rounded, since one that is nothing may come out as -1e-18."""
    return round(float(differences.mean()), 12) + 0.0


def draws_for_quantile(quantile: float, confidence: float) -> int:
    """Fewest independent values of which the largest bounds a quantile, 0.5 or above, from above.

    The largest of n lies below the quantile with probability quantile ** n.
    """
    return math.ceil(math.log((1.0 - confidence) / 2.0) / math.log(quantile))
