"""Exact intervals for shares and quantiles of small samples.

Shares never get a bootstrap (an all-success cell has none); quantiles never get a normal
approximation. Sources: Clopper and Pearson 1934; David and Nagaraja, Order Statistics, 7.1.
"""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

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
    lower = (
        0.0 if successes == 0 else float(scipy.stats.beta.ppf(tail, successes, n - successes + 1))
    )
    upper = (
        1.0 if successes == n else float(scipy.stats.beta.isf(tail, successes + 1, n - successes))
    )
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
    low = int(scipy.stats.binom.ppf(tail, n, quantile)) if n else 0
    while low > 0 and scipy.stats.binom.cdf(low - 1, n, quantile) > tail:
        low -= 1
    high = int(scipy.stats.binom.isf(tail, n, quantile)) + 1 if n else 1
    while high <= n and scipy.stats.binom.sf(high - 1, n, quantile) > tail:
        high += 1
    lower = float(ordered[low - 1]) if low >= 1 else -math.inf
    upper = float(ordered[high - 1]) if high <= n else math.inf
    return lower, upper


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
