"""An action in the checker's own words: which number is which, and the rotation of six of them.

What an action is stands in `contract.action` and `contract.rotation` too, where those read it who
are checked here. A mistake there must not be the checker's as well, so nothing of them is used; a
test holds the two against each other.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ACTION_DIM = 10
POSITION, ROTATION, GRIPPER = slice(0, 3), slice(3, 9), 9
LEAST = 1e-6
"""A column that is no longer, or is no further from the line of the other one, turns nothing."""


def turned_by(columns: Array) -> Array:
    """The rotation whose first two columns are given: the first as it points, the second near it.

    Args:
        columns: Two columns, one after the other, of any length and angle. Shape (..., 6).

    Returns:
        Shape (..., 3, 3); all NaN where they span no plane, which no comparison passes.
    """
    first, second = columns[..., :3], columns[..., 3:]
    x = _unit(first)
    z = _unit(np.cross(x, second))
    return np.stack([np.where(np.isnan(z), np.nan, x), np.cross(z, x), z], axis=-1)


def two_columns(rotation: Array) -> Array:
    """The first two columns of a rotation, one after the other. Shapes (3, 3) to (6,)."""
    return rotation.T[:2].ravel()


def angle_rad(first: Array, second: Array) -> Array:
    """Angle from a rotation to another, rad, by the half of it. Shapes (..., 3, 3) to (...).

    The matrices are sqrt(8) sin(angle / 2) apart, and the trace of one turned back by the other is
    4 cos(angle / 2)^2 - 1: exact where the angle is small, to 1e-7 rad near half a turn.
    """
    apart = np.sqrt(np.sum((first - second) ** 2, axis=(-2, -1)) / 8)
    along = np.sqrt(np.maximum(np.sum(first * second, axis=(-2, -1)) + 1, 0)) / 2
    return np.asarray(2 * np.arctan2(apart, along))


def _unit(vectors: Array) -> Array:
    length = np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))
    return np.asarray(vectors / np.where(length > LEAST, length, np.nan))
