"""Rest-to-rest motions at the action rate: a smooth path and a smooth speed along it."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]

ACTION_PERIOD_S = 0.05
# Fine time grid on which the speed profile is built and smoothed.
GRID_PERIOD_S = 0.005
# The trapezoid of speed is averaged over this time, which bounds the jerk.
SMOOTHING_S = 0.15


def travel(points_m: Array, *, speed_m_s: float, acceleration_m_s2: float) -> Array:
    """Positions, one per action period, along a cubic spline through points.

    Starts and ends at rest; the last position is the last point exactly.

    Args:
        points_m: Points to pass, two or more. Shape (n, 3), m.
        speed_m_s: Largest speed, m/s, > 0.
        acceleration_m_s2: Largest acceleration along the path, m/s2, > 0.

    Returns:
        Shape (m, 3), m >= 1; the first position lies one period after the start.
    """
    chords = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    keep = np.concatenate([[True], chords > 1e-6])
    if keep.sum() < 2:
        return points_m[-1:].copy()
    knots = np.concatenate([[0.0], np.cumsum(chords[keep[1:]])])
    spline = CubicSpline(knots, points_m[keep])
    dense = np.linspace(0.0, knots[-1], 400)
    path = spline(dense)
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    progress = _rest_to_rest(float(lengths[-1]), speed_m_s, acceleration_m_s2)
    return np.asarray(spline(np.interp(progress, lengths, dense)))


def _rest_to_rest(length_m: float, speed_m_s: float, acceleration_m_s2: float) -> Array:
    peak = min(speed_m_s, float(np.sqrt(length_m * acceleration_m_s2)))
    ramp_s = peak / acceleration_m_s2
    cruise_s = max(length_m / peak - ramp_s, 0.0)
    total_s = 2 * ramp_s + cruise_s
    time_s = np.arange(0.0, total_s + SMOOTHING_S + GRID_PERIOD_S, GRID_PERIOD_S)
    speed = np.clip(np.minimum(time_s, total_s - time_s) * acceleration_m_s2, 0.0, peak)
    width = round(SMOOTHING_S / GRID_PERIOD_S)
    smooth = np.convolve(speed, np.full(width, 1.0 / width))[: len(speed)]
    distance = np.concatenate([[0.0], np.cumsum(smooth[:-1])])
    distance *= length_m / distance[-1]
    periods = int(np.ceil(time_s[-1] / ACTION_PERIOD_S - 1e-9))
    ticks = ACTION_PERIOD_S * np.arange(1, periods + 1)
    return np.asarray(np.interp(ticks, time_s, distance))


def min_jerk(share: float) -> float:
    """Minimum-jerk blend from 0 to 1 (Flash and Hogan 1985)."""
    s = min(max(share, 0.0), 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
