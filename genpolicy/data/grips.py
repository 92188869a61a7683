"""A number that knows two values: a hand that is told to open or to close."""

import numpy as np
from numpy.typing import NDArray

TWO_VALUES = 0.9


def is_two_valued(values: NDArray[np.float64]) -> bool:
    """Whether nearly all rows hold one of two values.

    Args:
        values: Shape (n,).
    """
    counts = np.sort(np.unique(values, return_counts=True)[1])[::-1]
    return bool(counts[:2].sum() >= TWO_VALUES * len(values))
