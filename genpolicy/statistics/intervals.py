"""Intervals for shares, quantiles and statistics of small samples.

Shares never get a bootstrap (an all-success cell has none); quantiles never get a normal
approximation. Sources: Clopper and Pearson 1934; Wilson 1927; David and Nagaraja, Order
Statistics, 7.1; Efron 1987 (BCa).
"""

import math
import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from genpolicy.errors import ContractError, NonFiniteError

Array = NDArray[np.float64]


def clopper_pearson(successes: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Exact two-sided interval of a success probability.

    Args:
        successes: Successes, 0 to `n`.
        n: Trials; with 0 nothing is known and the answer is (0, 1).
        confidence: Coverage that holds for every true probability, between 0 and 1. Each end on
            its own is a one-sided bound of confidence (1 + confidence) / 2.

    Raises:
        ContractError: Counts that cannot be.
    """
    _check_counts(successes, n, confidence)
    tail = (1.0 - confidence) / 2.0
    lower = 0.0 if successes == 0 else float(stats.beta.ppf(tail, successes, n - successes + 1))
    upper = 1.0 if successes == n else float(stats.beta.isf(tail, successes + 1, n - successes))
    return lower, upper


def wilson(successes: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson score interval: for plots; gates use `clopper_pearson`.

    Raises:
        ContractError: Counts that cannot be.
    """
    _check_counts(successes, n, confidence)
    if n == 0:
        return 0.0, 1.0
    z = float(stats.norm.isf((1.0 - confidence) / 2.0))
    share = successes / n
    centre = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    lower = 0.0 if successes == 0 else max(0.0, centre - half)
    upper = 1.0 if successes == n else min(1.0, centre + half)
    return lower, upper


def order_statistic_interval(
    values: Array, quantile: float, confidence: float = 0.95
) -> tuple[float, float]:
    """Distribution-free interval of a quantile between two order statistics.

    Args:
        values: Independent draws. Shape (n,).
        quantile: Which quantile, between 0 and 1.
        confidence: Coverage, at least.

    Returns:
        Lower and upper end in the unit of `values`; -inf or inf where the sample is too small to
        bound that side.

    Raises:
        NonFiniteError: A value is NaN or infinite.
    """
    _check_finite(values, "the sample of a quantile interval")
    _check_share(quantile, "quantile")
    _check_share(confidence, "confidence")
    ordered, n = np.sort(values), len(values)
    tail = (1.0 - confidence) / 2.0
    # P(X_(r) > q) = P(Bin(n, q) < r) <= tail for the largest such r; mirrored above.
    low = int(stats.binom.ppf(tail, n, quantile)) if n else 0
    while low > 0 and stats.binom.cdf(low - 1, n, quantile) > tail:
        low -= 1
    high = int(stats.binom.isf(tail, n, quantile)) + 1 if n else 1
    while high <= n and stats.binom.sf(high - 1, n, quantile) > tail:
        high += 1
    lower = float(ordered[low - 1]) if low >= 1 else -math.inf
    upper = float(ordered[high - 1]) if high <= n else math.inf
    return lower, upper


def bootstrap_interval(
    values: Array,
    statistic: Callable[..., Array],
    *,
    rng: np.random.Generator,
    confidence: float = 0.95,
    resamples: int = 2000,
) -> tuple[float, float]:
    """BCa bootstrap interval of a statistic; percentile where BCa has no answer.

    Args:
        values: Independent draws. Shape (n,), n >= 1.
        statistic: Called as `statistic(sample, axis=-1)`.
        rng: Generator of the resampling.
        confidence: Nominal coverage.
        resamples: Bootstrap samples.

    Returns:
        Lower and upper end; both equal the statistic for a constant sample.

    Raises:
        ContractError: Fewer than one value.
        NonFiniteError: A value is NaN or infinite.
    """
    _check_finite(values, "the sample of a bootstrap interval")
    _check_share(confidence, "confidence")
    if len(values) == 0:
        raise ContractError(
            where="the sample of a bootstrap interval",
            found="empty",
            expected="at least one value",
            action="Report the cell as not measured.",
        )
    if np.ptp(values) == 0.0:
        point = float(statistic(values, axis=-1))
        return point, point
    for method in ("BCa", "percentile"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            interval = stats.bootstrap(
                (values,),
                statistic,
                confidence_level=confidence,
                n_resamples=resamples,
                method=method,
                rng=np.random.Generator(np.random.PCG64(int(rng.integers(1 << 62)))),
            ).confidence_interval
        if math.isfinite(interval.low) and math.isfinite(interval.high):
            return float(interval.low), float(interval.high)
    return -math.inf, math.inf


def _check_counts(successes: int, n: int, confidence: float) -> None:
    _check_share(confidence, "confidence")
    if not 0 <= successes <= n:
        raise ContractError(
            where="a share",
            found=f"{successes} successes of {n}",
            expected="0 <= successes <= n",
            action="Count trials and successes from the same rows.",
        )


def _check_share(value: float, name: str) -> None:
    if not 0.0 < value < 1.0:
        raise ContractError(
            where=name,
            found=repr(value),
            expected="a number between 0 and 1, ends excluded",
            action="Correct the setting.",
        )


def _check_finite(values: Array, where: str) -> None:
    if not np.all(np.isfinite(values)):
        raise NonFiniteError(
            where=where,
            found="with NaN or infinity",
            expected="finite numbers",
            action="Count missing values on their own; never fill them.",
        )
