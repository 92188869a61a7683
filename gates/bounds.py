"""Bounds of shares whose rows are not all independent.

Rows that share an episode, an observation or a start are one draw, not many. The exact bound is
therefore taken over the clusters: the share is that of the rows, the number of trials that of
the clusters, and the count is rounded to the unfavourable side.
"""

import itertools
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gates.evidence import Array, MissingEvidenceError
from genpolicy.statistics.intervals import clopper_pearson, order_statistic_interval


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
    product = round(share * trials, 9)
    successes = math.floor(product) if favourable else math.ceil(product)
    lower, upper = clopper_pearson(successes, trials, confidence)
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
    bounds: dict[str, tuple[float, float, float]] = {}
    for name, (hits, clusters) in shares.items():
        share, lower, _ = share_interval(hits, clusters, confidence=confidence, favourable=True)
        upper = share_interval(hits, clusters, confidence=confidence, favourable=False)[2]
        bounds[name] = (share, lower, upper)
    found = []
    for more, less in itertools.permutations(bounds, 2):
        (p, p_lower, p_upper), (q, q_lower, q_upper) = bounds[more], bounds[less]
        upper = p - q + math.hypot(p_upper - p, q - q_lower)
        lower = p - q - math.hypot(p - p_lower, q_upper - q)
        found.append((upper, max(lower, 0.0), more, less))
    upper, lower, more, less = max(found)
    return (lower, upper), more, less


def upper_quantile(
    values: Array, quantile: float, *, confidence: float
) -> tuple[float, tuple[float, float] | None]:
    """Order statistic at or above a quantile, with its distribution-free interval.

    Returns:
        The order statistic, and the interval where the sample is large enough for both ends.

    Raises:
        MissingEvidenceError: No values.
    """
    if len(values) == 0:
        raise MissingEvidenceError("no values to take a quantile of")
    point = float(np.quantile(values, quantile, method="higher"))
    lower, upper = order_statistic_interval(values, quantile, confidence)
    return point, (lower, upper) if math.isfinite(lower) and math.isfinite(upper) else None
