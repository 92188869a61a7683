"""The six-number rotation: the first two columns of a rotation matrix, and back.

Source: Zhou et al., arXiv 1812.07035 (continuous rotation representation); Gram-Schmidt back.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEGENERATE_NORM = 1e-6


def rotation_to_6d(rotation: Array) -> Array:
    """First two columns of a rotation matrix, one after the other.

    Args:
        rotation: Rotation matrices. Shape (..., 3, 3).

    Returns:
        Shape (..., 6).
    """
    return np.concatenate([rotation[..., :, 0], rotation[..., :, 1]], axis=-1)


def rotation_from_6d(columns: Array) -> Array:
    """Rotation matrix of two columns by Gram-Schmidt; NaN where they span no plane.

    Args:
        columns: Two columns, not necessarily orthonormal. Shape (..., 6).

    Returns:
        Rotation matrices; all NaN where a column is (nearly) zero or both are parallel, so that
        whoever compares a margin with `>= 0` rejects it. Shape (..., 3, 3).
    """
    first, second = columns[..., :3], columns[..., 3:]
    first_norm = np.linalg.norm(first, axis=-1, keepdims=True)
    x = np.divide(first, first_norm, where=first_norm > DEGENERATE_NORM, out=_nan_like(first))
    rest = second - np.sum(x * second, axis=-1, keepdims=True) * x
    rest_norm = np.linalg.norm(rest, axis=-1, keepdims=True)
    y = np.divide(rest, rest_norm, where=rest_norm > DEGENERATE_NORM, out=_nan_like(rest))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def orthonormality_error(columns: Array) -> Array:
    """Largest deviation of the two columns from unit length and right angle. Shape (...)."""
    first, second = columns[..., :3], columns[..., 3:]
    worst: Array = np.max(
        np.stack(
            [
                np.abs(np.linalg.norm(first, axis=-1) - 1.0),
                np.abs(np.linalg.norm(second, axis=-1) - 1.0),
                np.abs(np.sum(first * second, axis=-1)),
            ],
            axis=-1,
        ),
        axis=-1,
    )
    return worst


def angle_between(first: Array, second: Array) -> Array:
    """Angle of the rotation from `first` to `second`, rad. Shapes (..., 3, 3) to (...)."""
    relative = np.einsum("...ji,...jk->...ik", first, second)
    skew = np.stack(
        [
            relative[..., 2, 1] - relative[..., 1, 2],
            relative[..., 0, 2] - relative[..., 2, 0],
            relative[..., 1, 0] - relative[..., 0, 1],
        ],
        axis=-1,
    )
    trace = np.trace(relative, axis1=-2, axis2=-1)
    angle: Array = np.arctan2(np.linalg.norm(skew, axis=-1), trace - 1.0)
    return angle


def _nan_like(array: Array) -> Array:
    return np.full(array.shape, np.nan)
