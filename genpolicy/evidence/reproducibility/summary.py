"""Summaries of latencies: quantiles with order-statistic intervals, and two kinds of p95.

The sum of the terms' p95s and the p95 of the sums differ: the first assumes that every term is
slow at the same time, the second is what was seen. Both are reported.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from genpolicy.errors import ContractError

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Quantile:
    """A quantile with its interval.

    Attributes:
        value_s: The order statistic, s.
        lower_s: Lower end of the interval, s; None when the sample is too small to bound it.
        upper_s: Upper end, s; None likewise. Too small is unknown, not wide.
    """

    value_s: float
    lower_s: float | None
    upper_s: float | None


@dataclass(frozen=True)
class LatencySummary:
    """Distribution of one latency.

    Attributes:
        count: Number of measurements.
        p50: Median.
        p95: 95 % quantile.
        max_s: Largest measurement, s.
    """

    count: int
    p50: Quantile
    p95: Quantile
    max_s: float


@dataclass(frozen=True)
class EndToEnd:
    """Two answers to "how slow is one in twenty".

    Attributes:
        sum_of_p95_s: Sum of the terms' p95s, s.
        end_to_end_p95_s: p95 of the per-invocation sums, s.
    """

    sum_of_p95_s: float
    end_to_end_p95_s: float


def summarise(seconds: Sequence[float]) -> LatencySummary:
    """Median, p95 and maximum of durations, s.

    Raises:
        ContractError: No duration, or one that is negative or not finite.
    """
    values = _sorted(seconds)
    return LatencySummary(
        count=len(values),
        p50=quantile(values, 0.50),
        p95=quantile(values, 0.95),
        max_s=values[-1],
    )


def quantile(seconds: Sequence[float], level: float) -> Quantile:
    """The order statistic of rank ceil(n level), with a distribution-free interval.

    Args:
        seconds: Durations, s.
        level: Quantile level in (0, 1).

    Source:
        The number of measurements below the true quantile is binomial(n, level).
    """
    values = _sorted(seconds)
    count = len(values)
    tail = (1.0 - CONFIDENCE) / 2.0
    # P(X_(r) > q) = P(B < r) and P(X_(r) < q) <= P(B >= r), with B ~ binomial(n, level)
    lower = int(binom.ppf(tail, count, level))
    upper = int(binom.ppf(1.0 - tail, count, level)) + 1
    if lower > 0 and not binom.cdf(lower - 1, count, level) <= tail:
        lower -= 1
    return Quantile(
        value_s=values[math.ceil(count * level) - 1],
        lower_s=values[lower - 1] if lower >= 1 else None,
        upper_s=values[upper - 1] if upper <= count else None,
    )


def end_to_end(terms: Mapping[str, Sequence[float]]) -> EndToEnd:
    """Sum of p95s and p95 of sums over terms measured in the same invocations.

    Args:
        terms: Durations of each term, s; entry i of every term belongs to invocation i.

    Raises:
        ContractError: Terms of different lengths.
    """
    if len({len(values) for values in terms.values()}) != 1:
        raise ContractError(
            where="latency terms",
            found=str({name: len(values) for name, values in terms.items()}),
            expected="the same invocations for every term",
            action="Measure all terms of an invocation, or leave the invocation out.",
        )
    totals = np.sum([np.asarray(values, dtype=float) for values in terms.values()], axis=0)
    return EndToEnd(
        sum_of_p95_s=math.fsum(quantile(values, 0.95).value_s for values in terms.values()),
        end_to_end_p95_s=quantile(totals.tolist(), 0.95).value_s,
    )


def _sorted(seconds: Sequence[float]) -> list[float]:
    values = sorted(float(value) for value in seconds)
    if not values or not all(math.isfinite(value) and value >= 0.0 for value in values):
        raise ContractError(
            where="latency measurements",
            found="empty, negative or not finite",
            expected="at least one finite duration >= 0 in s",
            action="Measure again; a missing term is unknown, never zero.",
        )
    return values
