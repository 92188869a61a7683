"""Least smoothing of a joint path that keeps it within rate limits.

A generated chunk carries jitter of a millimetre or so, which at the action period is a large
acceleration. The path is smoothed by penalised least squares with the commands before it as its
fixed beginning; of a fixed ladder of penalties the smallest is taken that keeps to the limits.
A path within the limits is left alone, and so is one that no penalty brings within them.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from genpolicy.robot.limits import RobotLimits

Array = NDArray[np.float64]

PENALTIES = tuple(float(p) for p in np.geomspace(0.03, 3000.0, 18))
ORDER = 2  # differences of second order are penalised: accelerations
TIGHTENED = 0.97  # a smoothed path keeps this part of its limits, so that it is left alone later


@lru_cache(maxsize=64)
def _ladder(points: int, fixed_points: int) -> tuple[Array, Array]:
    """Per penalty, matrices on the path (L, n, n) and on the fixed points before it (L, n, s)."""
    total = points + fixed_points
    differences = np.diff(np.eye(total), n=ORDER, axis=0) if total > ORDER else np.zeros((0, total))
    fixed, free = differences[:, :fixed_points], differences[:, fixed_points:]
    on_path, on_fixed = [], []
    for penalty in PENALTIES:
        inverse = np.linalg.inv(np.eye(points) + penalty * free.T @ free)
        on_path.append(inverse)
        on_fixed.append(-penalty * inverse @ free.T @ fixed)
    return np.stack(on_path), np.stack(on_fixed)


def rate_excess(path: Array, *, fixed_points: int, limits: RobotLimits, period_s: float) -> Array:
    """Largest share of a joint rate limit that a path uses; above 1 it breaks one.

    Args:
        path: Fixed points and then the path, rad. Shape (..., s + n, J).
        fixed_points: How many of the points are fixed, >= 1.
        limits: Limits that may be used.
        period_s: Time between points.

    Returns:
        Shape (...).
    """
    used = np.zeros(path.shape[:-2])
    bounds = (limits.velocity_rad_s, limits.acceleration_rad_s2, limits.jerk_rad_s3)
    rates = path
    for order, bound in enumerate(bounds, start=1):
        rates = np.diff(rates, axis=-2) / period_s
        # Differences among the fixed points alone are past; nothing can change them.
        own = rates[..., max(fixed_points - order, 0) :, :]
        if own.shape[-2]:
            used = np.maximum(used, np.max(np.abs(own) / bound, axis=(-2, -1)))
    return used


def smoothed(path: Array, fixed: Array, *, limits: RobotLimits, period_s: float) -> Iterator[Array]:
    """Paths within the limits, least smoothed first; none where the path needs no smoothing.

    Args:
        path: Joint positions, rad. Shape (n, J).
        fixed: Commands before it, oldest first, at least one. Shape (s, J).
        limits: Limits that may be used.
        period_s: Time between points.

    Yields:
        Shape (n, J).

    Source:
        Whittaker's smoother (1922) with a fixed beginning.
    """
    fixed_points = len(fixed)
    whole = np.concatenate([fixed, path])
    if rate_excess(whole, fixed_points=fixed_points, limits=limits, period_s=period_s) <= 1.0:
        return
    on_path, on_fixed = _ladder(len(path), fixed_points)
    candidates = on_path @ path + on_fixed @ fixed
    beginnings = np.broadcast_to(fixed, (len(PENALTIES), *fixed.shape))
    whole = np.concatenate([beginnings, candidates], axis=1)
    used = rate_excess(whole, fixed_points=fixed_points, limits=limits, period_s=period_s)
    for rung in np.flatnonzero(used <= TIGHTENED):
        yield candidates[rung]
