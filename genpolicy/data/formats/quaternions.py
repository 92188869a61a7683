"""Four numbers that are one rotation: of unit norm, with a sign that means nothing."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NORM_TOLERANCE = 0.01
# A damaged row must not decide what the others are.
UNIT_SHARE = 0.99


def is_quaternion(values: Array) -> bool:
    """Whether four numbers have unit norm in nearly every row, and are no one-hot of flags.

    Args:
        values: Shape (n, 4).
    """
    if values.ndim != 2 or values.shape[1] != 4 or not len(values):
        return False
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs((values**2).sum(axis=1) - 1.0)
    flags = np.all((values == 0.0) | (values == 1.0), axis=1)
    unit = np.mean(off <= 2.0 * NORM_TOLERANCE) >= UNIT_SHARE
    return bool(unit and not flags.all())
