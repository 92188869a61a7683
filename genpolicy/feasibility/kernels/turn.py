"""Rotations of one row: from six numbers, and the angle between two (`contract.rotation`)."""

import math

import numpy as np
from numpy.typing import NDArray

from genpolicy.compiled import compiled
from genpolicy.contract.rotation import DEGENERATE_NORM

Array = NDArray[np.float64]


@compiled("b1(f8[::1], i8, f8[:,::1])")
def from_columns(row: Array, at: int, result: Array) -> bool:
    """Rotation of the six numbers of a row from `at` on, by Gram-Schmidt.

    Args:
        row: What holds them. Shape (D,).
        at: Where they begin.
        result: Written; all NaN where they span no rotation. Shape (3, 3).

    Returns:
        Whether they do.
    """
    a, b, c = row[at], row[at + 1], row[at + 2]
    x, y, z = row[at + 3], row[at + 4], row[at + 5]
    first = math.sqrt(a * a + b * b + c * c)
    found = first > DEGENERATE_NORM
    a, b, c = a / first, b / first, c / first
    along = a * x + b * y + c * z
    x, y, z = x - along * a, y - along * b, z - along * c
    second = math.sqrt(x * x + y * y + z * z)
    if not (found and second > DEGENERATE_NORM):
        result[:, :] = np.nan
        return False
    x, y, z = x / second, y / second, z / second
    result[0, 0], result[1, 0], result[2, 0] = a, b, c
    result[0, 1], result[1, 1], result[2, 1] = x, y, z
    result[0, 2], result[1, 2], result[2, 2] = b * z - c * y, c * x - a * z, a * y - b * x
    return True


@compiled("void(f8[:,:,::1], i8, f8[:,:,:,::1])")
def from_rows(rows: Array, at: int, result: Array) -> None:
    """`from_columns` of all rows (B, n, D), into an array of shape (B, n, 3, 3)."""
    for chunk in range(rows.shape[0]):
        for row in range(rows.shape[1]):
            from_columns(rows[chunk, row], at, result[chunk, row])


@compiled("void(f8[:,::1], f8[::1], i8)")
def to_columns(rotation: Array, row: Array, at: int) -> None:
    """Write the first two columns of a rotation into a row, from `at` on."""
    for i in range(3):
        row[at + i], row[at + 3 + i] = rotation[i, 0], rotation[i, 1]


@compiled("f8(f8[:,::1], f8[:,::1])")
def angle(first: Array, second: Array) -> float:
    """Angle of the rotation from the first to the second, rad."""
    trace, x, y, z = 0.0, 0.0, 0.0, 0.0
    for j in range(3):  # relative = first.T @ second
        trace += first[j, 0] * second[j, 0] + first[j, 1] * second[j, 1]
        trace += first[j, 2] * second[j, 2]
        x += first[j, 2] * second[j, 1] - first[j, 1] * second[j, 2]
        y += first[j, 0] * second[j, 2] - first[j, 2] * second[j, 0]
        z += first[j, 1] * second[j, 0] - first[j, 0] * second[j, 1]
    return math.atan2(math.sqrt(x * x + y * y + z * z), trace - 1.0)
