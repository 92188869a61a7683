"""Intervals where rows share a draw: a start, an observation, an episode.

Whole clusters are drawn again with replacement, so that rows of one cluster count as the one draw
that they are. Two ends of that method are closed: clusters that do not vary (no miss on any start)
would give an interval of no width, and a quantile near the largest value has nothing above it to
draw: there the exact interval of as many independent draws as the rows are worth decides. Sources:
Efron and Tibshirani 1993, chapter 13; Field and Welsh 2007 for clusters; Korn and Graubard 1998
for the number of draws that rows of a cluster are worth.
"""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.statistics.intervals import clopper_pearson, order_statistic_interval

Array = NDArray[np.float64]

DRAWS = 2000
MINIMUM_CLUSTERS = 20
"""Fewer clusters are no distribution to draw from."""


def ratio_interval(
    hits: Array, whole: Array, *, confidence: float, rng: np.random.Generator
) -> tuple[float, float]:
    """Interval of sum(hits) / sum(whole), a share, over independent clusters.

    Neither end lies closer to 0 or 1 than the exact interval of as many clusters of which none
    (or every one) is a hit: what so many draws cannot exclude, no resampling of them can.

    Args:
        hits: Part of each cluster, 0 to `whole`. Shape (n,).
        whole: Size of each cluster, > 0. Shape (n,).
        confidence: Nominal coverage.
        rng: Generator of the draws.

    Raises:
        ContractError: A part larger than its whole, a whole that is not positive, or no cluster.
    """
    hits, whole = np.asarray(hits, dtype=np.float64), np.asarray(whole, dtype=np.float64)
    n = len(whole)
    sound = len(hits) == n > 0 and np.all(whole > 0) and np.all((hits >= 0) & (hits <= whole))
    if not sound:
        raise ContractError(
            where="a share over clusters",
            found="a part outside its whole, or an empty cluster",
            expected="0 <= hits <= whole and whole > 0 in every cluster",
            action="Count both from the same rows.",
        )
    counts = rng.multinomial(n, np.full(n, 1.0 / n), size=DRAWS).astype(np.float64)
    ratios = (counts @ hits) / (counts @ whole)
    tail = (1.0 - confidence) / 2.0
    lower, upper = np.quantile(ratios, [tail, 1.0 - tail])
    unseen = clopper_pearson(0, n, confidence)[1]
    return min(float(lower), 1.0 - unseen), max(float(upper), unseen)


def quantile_interval(
    values: Array,
    clusters: NDArray[np.generic],
    quantile: float,
    *,
    confidence: float,
    rng: np.random.Generator,
) -> tuple[float, float]:
    """Interval of a quantile of rows that come in clusters; its ends are values that occurred.

    With one row per cluster it is the exact one between order statistics. Else it is the wider, at
    either end, of the resampled one and the exact one of the draws that the rows are worth: where
    a cluster's rows are one, resampling 20 of them finds an end that 20 draws do not have.

    Args:
        values: One per row. Shape (n,).
        clusters: Cluster of each row. Shape (n,).
        quantile: Which quantile, between 0 and 1.
        confidence: Coverage; nominal where a cluster has several rows.
        rng: Generator of the draws.

    Returns:
        Lower and upper end; -inf or inf where the sample is too small to bound that side.

    Raises:
        NonFiniteError: A value is NaN or infinite.
    """
    values = np.asarray(values, dtype=np.float64)
    _, member = np.unique(clusters, return_inverse=True)
    n = int(member.max()) + 1 if len(member) else 0
    if n == len(values):
        return order_statistic_interval(values, quantile, confidence)
    if not np.all(np.isfinite(values)):
        raise NonFiniteError(
            where="the sample of a quantile interval",
            found="with NaN or infinity",
            expected="finite numbers",
            action="Count missing values on their own; never fill them.",
        )
    if n < MINIMUM_CLUSTERS:
        return -math.inf, math.inf
    order = np.argsort(values, kind="stable")
    ranks = _drawn_ranks(member.reshape(-1)[order], n, quantile, rng)
    tail = (1.0 - confidence) / 2.0
    worth = _effective_draws(values, member.reshape(-1), quantile, tail)
    exact = _exact_ranks(len(values), worth, quantile, tail)
    low = min(int(np.quantile(ranks, tail, method="lower")), exact[0])
    high = max(int(np.quantile(ranks, 1.0 - tail, method="higher")), exact[1])
    lower = float(values[order[low]]) if low >= 0 else -math.inf
    upper = float(values[order[high]]) if high < len(values) else math.inf
    return lower, upper


def _effective_draws(values: Array, member: NDArray[np.int64], quantile: float, tail: float) -> int:
    """Independent draws that know as much of the share below the quantile as these rows."""
    rows = len(values)
    below = (values <= np.quantile(values, quantile, method="higher")).astype(np.float64)
    share = below.mean()
    alone = share * (1.0 - share) * rows
    if alone == 0.0:
        # Every row is the quantile itself, or below: a cluster is worth one draw.
        return int(member.max()) + 1
    sums = np.bincount(member, weights=below - share)
    n = len(sums)
    together = float(sums @ sums) * n / (n - 1)
    few = scipy.stats.t.isf(tail, rows - 1) / scipy.stats.t.isf(tail, n - 1)
    return min(rows, math.floor(rows * alone / together * few**2)) if together > 0.0 else rows


def _exact_ranks(rows: int, draws: int, quantile: float, tail: float) -> tuple[int, int]:
    """Ranks, from 0, of the exact interval of so many draws; -1 or `rows` where there is none."""
    low = int(scipy.stats.binom.ppf(tail, draws, quantile))
    high = int(scipy.stats.binom.isf(tail, draws, quantile)) + 1
    first = math.floor((low - 1) / draws * rows) if low >= 1 else -1
    return first, math.ceil(high / draws * rows) - 1 if high <= draws else rows


def _drawn_ranks(
    member: NDArray[np.int64], n: int, quantile: float, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Rank of the quantile in each draw of clusters; `member` in the order of the values."""
    ranks = np.empty(DRAWS, dtype=np.int64)
    for draw in range(DRAWS):
        weights = np.bincount(rng.integers(0, n, size=n), minlength=n)[member]
        total = np.cumsum(weights)
        ranks[draw] = np.searchsorted(total, quantile * total[-1], side="left")
    return ranks
