"""Outlines of shapes as a drawing shows them: seen from above and from the side."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from genpolicy.robot.shapes import Shape

Array = NDArray[np.float64]
Placed = tuple[Shape, Array, Array]
"""A shape with its rotation (3, 3) and position (3,), m, in the base frame."""

ROUND_CORNERS = 24
ABOVE, ASIDE = (0, 1), (0, 2)
"""Axes of the two views: x and y, x and z."""


def outlines(placed: Iterable[Placed]) -> tuple[Array, Array]:
    """Corners around some shapes taken together, from above (n, 2) and from the side (m, 2), m.

    Raises:
        ValueError: No shape.
    """
    points = np.concatenate(
        [_surface(shape) @ np.asarray(turned).T + np.asarray(at) for shape, turned, at in placed]
    )
    above, aside = (points[:, list(axes)] for axes in (ABOVE, ASIDE))
    return above[ConvexHull(above).vertices], aside[ConvexHull(aside).vertices]


def _surface(shape: Shape) -> Array:
    """Points whose hull is the shape, in its own frame. Shape (n, 3)."""
    x, y, z = shape.half_size_m
    if shape.kind == "box":
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        return np.asarray(signs * shape.half_size_m)
    turn = 2 * np.pi * np.arange(ROUND_CORNERS) / ROUND_CORNERS
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(ROUND_CORNERS)], axis=1)
    if shape.kind == "cylinder":
        return np.concatenate([ring * (x, y, 0) + (0, 0, end) for end in (-z, z)])
    # A sphere, and a capsule: a sphere at either end of its axis.
    ends = (-z, z) if shape.kind == "capsule" else (0.0,)
    tilts = np.pi * np.arange(ROUND_CORNERS // 2 + 1) / (ROUND_CORNERS // 2)
    ball = np.concatenate([x * (np.sin(t) * ring + (0, 0, np.cos(t))) for t in tilts])
    return np.concatenate([ball + np.array([0.0, 0.0, end]) for end in ends])
