"""How a person or a planner moves: along a smooth way, with speeds, rests and unsteadiness."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from benchmarks.audit.truth import SUB_STEPS, follow

Array = NDArray[np.float64]
FINE = 400


def way(points: Array, *, rows: int, rests: tuple[tuple[float, int], ...] = ()) -> Array:
    """Commands along a smooth way through the points, slow at both ends. Shape (T, D).

    Args:
        points: Where it leads. Shape (W, D).
        rows: Rows of motion.
        rests: (share of the way, rows) of each rest.
    """
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    fine = np.linspace(0.0, knots[-1], FINE)
    curve = PchipInterpolator(knots, points, axis=0)(fine)
    curve = _rounded(curve, FINE / 25.0)
    u = np.linspace(0.0, 1.0, rows)
    share = u + 0.8 * (u**3 * (10.0 - 15.0 * u + 6.0 * u**2) - u)
    for place, long in sorted(rests, reverse=True):
        at = int(np.searchsorted(share, place))
        share = np.concatenate([share[:at], np.full(long, share[min(at, rows - 1)]), share[at:]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    length = length + 1e-12 * np.arange(FINE)
    columns = [np.interp(share * length[-1], length, column) for column in curve.T]
    return np.stack(columns, axis=1)


def _rounded(curve: Array, width: float) -> Array:
    """Corners cut as a hand cuts them; both ends stay, or the start would tell the way."""
    reach = int(4 * width)
    before = 2.0 * curve[0] - curve[reach:0:-1]
    after = 2.0 * curve[-1] - curve[-2 : -reach - 2 : -1]
    smooth = gaussian_filter1d(np.concatenate([before, curve, after]), width, axis=0)
    return np.asarray(smooth[reach:-reach])


def wobble(rng: np.random.Generator, rows: int, width: int, *, size: float, slow: float) -> Array:
    """Smooth unsteadiness of standard deviation `size`, over `slow` rows. Shape (rows, width)."""
    white = rng.normal(size=(rows + 8 * int(slow), width))
    smooth = gaussian_filter1d(white, slow, axis=0)[4 * int(slow) : 4 * int(slow) + rows]
    return size * smooth / max(float(smooth.std()), 1e-9)


def plant(command: Array, *, rate_hz: float, lag_rows: float, constant_rows: float) -> Array:
    """What the robot does of its commands: dead time and a first order. Shape (T, D)."""
    period = 1.0 / rate_hz
    done = follow(
        command, period_s=period, delay_s=lag_rows * period, constant_s=constant_rows * period
    )
    return np.asarray(done[::SUB_STEPS][: len(command)])


def rests(
    rng: np.random.Generator, *, chance: float, longest: int
) -> tuple[tuple[float, int], ...]:
    """Rests of a person who thinks: none, one or two, anywhere on the way."""
    count = int(rng.binomial(2, chance))
    return tuple(
        (float(rng.uniform(0.1, 0.9)), int(rng.integers(3, longest))) for _ in range(count)
    )


def quaternion(yaw: Array, tilt: Array | None = None) -> Array:
    """Unit quaternions x, y, z, w of a tool that points down, turned by yaw and tilted. (T, 4)."""
    half = np.asarray(yaw) / 2.0
    lean = np.zeros_like(half) if tilt is None else np.asarray(tilt) / 2.0
    return np.stack(
        [np.cos(half) * np.cos(lean), np.sin(half) * np.cos(lean), np.sin(half) * np.sin(lean),
         np.cos(half) * np.sin(lean)], axis=1
    )  # fmt: skip
