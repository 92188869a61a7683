"""Several tests of one question: Holm's step-down adjustment (Holm 1979)."""

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError

Array = NDArray[np.float64]


def holm(p_values: Array) -> Array:
    """Adjusted p-values that control the family-wise error under any dependence.

    Args:
        p_values: One per test of the family. Shape (m,).

    Returns:
        Adjusted p-values, in the order given; reject where <= alpha. Shape (m,).

    Raises:
        ContractError: A p-value is outside [0, 1] or NaN.
    """
    p = np.asarray(p_values, dtype=np.float64)
    if not np.all((p >= 0.0) & (p <= 1.0)):
        raise ContractError(
            where="the p-values of a family of tests",
            found=f"{p.tolist()}",
            expected="numbers in [0, 1]",
            action="Leave out tests that were not run.",
        )
    order = np.argsort(p, kind="stable")
    factors = len(p) - np.arange(len(p))
    adjusted = np.minimum(1.0, np.maximum.accumulate(factors * p[order]))
    result = np.empty_like(p)
    result[order] = adjusted
    return result
