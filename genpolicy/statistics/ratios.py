"""A ratio of two sums over independent clusters, and its interval."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from genpolicy.errors import ContractError

Array = NDArray[np.float64]


def ratio_of_sums(
    numerator: Array, denominator: Array, *, confidence: float
) -> tuple[float, float, float]:
    """Sum of `numerator` over sum of `denominator`, with an interval over the clusters.

    The ratio estimator, linearised (Cochran, Sampling Techniques, 6.4): with R the ratio and n
    clusters, the standard error is sqrt(sum (x_i - R y_i)^2 / (n (n - 1))) / mean(y), and the
    interval that of Student's t with n - 1 degrees of freedom.

    Args:
        numerator: Total of each cluster. Shape (n,), n >= 2.
        denominator: Likewise; positive sum. Shape (n,).
        confidence: Coverage, about.

    Returns:
        Ratio, lower and upper end.

    Raises:
        ContractError: Fewer than two clusters, different lengths, values that are no numbers, or
            a denominator that is not positive.
    """
    finite = bool(np.isfinite(numerator).all() and np.isfinite(denominator).all())
    count, total = len(denominator), float(np.sum(denominator))
    if not (finite and count == len(numerator) >= 2 and total > 0 and 0.0 < confidence < 1.0):
        raise ContractError(
            where="a ratio of sums",
            found=f"{len(numerator)} and {count} clusters, denominator {total:g}",
            expected="two finite columns of at least two clusters, a positive denominator",
            action="Sum both columns over the same clusters.",
        )
    ratio = float(np.sum(numerator)) / total
    rest = np.asarray(numerator - ratio * denominator, dtype=np.float64)
    error = math.sqrt(float(rest @ rest) / (count * (count - 1))) / (total / count)
    reach = float(scipy.stats.t.isf((1.0 - confidence) / 2.0, count - 1)) * error
    return ratio, ratio - reach, ratio + reach
