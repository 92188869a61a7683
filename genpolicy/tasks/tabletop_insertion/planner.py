"""The classical planner alone: around the post on the shorter side, down into the hole, away.

It plans from observations that every policy sees, and remembers nothing. Where the arm is on its
way says how the way goes on, so that each chunk continues the one before. A search for the hole
goes by points around where the camera puts it; the next one follows from where the tip stands.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from genpolicy.contract.action import join_action
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.observation import OBSERVATION, PHASES
from genpolicy.tasks.tabletop_insertion.plans import min_jerk

Array = NDArray[np.float64]
Rows = tuple[Array, Array]
"""Positions (K, 3), m, and openings of the gripper (K,), m."""


class Pace(NamedTuple):
    """How fast a motion may be: m/s, and m/s2."""

    speed_m_s: float
    acceleration_m_s2: float


TRAVEL, DESCENT, RISE = Pace(0.22, 0.8), Pace(0.06, 0.5), Pace(0.18, 0.8)
CREEP = Pace(0.04, 0.5)

VIA_M, CRUISE_Z_M = 0.13, 0.15
HOVER_Z_M = scene.FIXTURE_TOP_M + scene.TIP_OFFSET_M + 0.040
ENTERED_Z_M = scene.FIXTURE_TOP_M + scene.TIP_OFFSET_M + 0.018
"""Low enough that the phase `insert` begins, above the rim."""
INSERT_Z_M = scene.FIXTURE_TOP_M + 0.014
UP_Z_M = scene.FIXTURE_TOP_M + 0.085
ALIGNED_M, STILL_M_S = 0.001, 0.02
"""Nearer than this to where it aims, and slower, the tip goes down."""
PRESSED_N, STIFFNESS_N_M, DEEPEST_M = 20.0, 3000.0, 0.015
CLEAR_M = 0.003
RIM_M = 0.010
"""The tip no further than this above or below the rim stands on it, if something presses."""
RING_M, RING = 0.002, 6
LIFT_M = 0.010
YAW_RAD_S = 0.5
FINE_M = 0.0005
OUT_OF_THE_WAY_M = 0.4
"""A post as far beside the arm as this stands in no way that the workspace allows."""


def plan_insertion(history: Array, *, horizons: HorizonConfig) -> Array:
    """A chunk from the last observations; see `genpolicy.tasks.planner.Planner`.

    Args:
        history: Oldest first. Shape (H_o, D_o).
        horizons: Of the ladder.

    Returns:
        Shape (K, 10).
    """
    rows, period_s = horizons.prediction_horizon, horizons.action_period_s
    seen = _Seen(history, period_s)
    positions, openings = _PLANS[seen.phase](seen, rows, period_s)
    turn = YAW_RAD_S * period_s * np.arange(1, rows + 1)
    yaw = seen.yaw_rad + np.clip(seen.hole_yaw_rad - seen.yaw_rad, -turn, turn)
    rotations = np.stack([scene.tool_rotation(angle) for angle in yaw])
    return np.stack([join_action(*row) for row in zip(positions, rotations, openings, strict=True)])


class _Seen:
    """What the newest observation says, and how fast the arm goes."""

    def __init__(self, history: Array, period_s: float) -> None:
        slices, newest = OBSERVATION.slices, history[-1]
        at = slices["tcp_position_m"]
        self.tcp_m = newest[at]
        before = history[-2][at] if len(history) > 1 else self.tcp_m
        self.velocity_m_s = (self.tcp_m - before) / period_s
        rotation = newest[slices["tcp_rotation"]]
        self.yaw_rad = float(np.arctan2(rotation[1], rotation[0]))
        self.opening_m = float(newest[slices["gripper_opening_m"]][0])
        self.force_n = float(np.linalg.norm(newest[slices["wrench_n"]]))
        hole = newest[slices["hole_pose"]]
        self.hole_m = hole[:2]
        self.hole_yaw_rad = float(np.arctan2(hole[3], hole[2]))
        self.post_y_m = float(newest[slices["post_position_m"]][0])
        self.phase = PHASES[int(np.argmax(newest[slices["phase"]]))]


def _approach(seen: _Seen, rows: int, period_s: float) -> Rows:
    """Along the way around the post; what the arm is beside it fades."""
    hover = np.append(seen.hole_m, HOVER_Z_M)
    if np.linalg.norm(hover - seen.tcp_m) < FINE_M:  # no way is left to go round anything
        return _straight(seen, hover, rows, period_s, TRAVEL), _held(rows)
    length, at = _way(seen)
    dense = np.linspace(0.0, length, 400)
    points = at(dense)
    nearest = int(np.argmin(np.linalg.norm(points - seen.tcp_m, axis=1)))
    ahead = points[min(nearest + 1, 399)] - points[max(nearest - 1, 0)]
    along = ahead / np.linalg.norm(ahead)
    speed = max(0.0, float(seen.velocity_m_s @ along))
    gone = dense[nearest] + _distances(length - dense[nearest], speed, rows, period_s, TRAVEL)
    beside = seen.tcp_m - points[nearest]
    share = np.array([1.0 - min_jerk((row + 1) / 8) for row in range(rows)])
    return at(gone) + share[:, None] * beside, _held(rows)


def _align(seen: _Seen, rows: int, period_s: float) -> Rows:
    """Over the hole, and low enough that insertion begins; not lower before it has."""
    beside_m = float(np.linalg.norm(seen.tcp_m[:2] - seen.hole_m))
    if beside_m > ALIGNED_M or float(np.linalg.norm(seen.velocity_m_s[:2])) > STILL_M_S:
        hover = np.append(seen.hole_m, HOVER_Z_M)
        return _straight(seen, hover, rows, period_s, TRAVEL), _held(rows)
    return _down(seen, np.append(seen.hole_m, ENTERED_Z_M), rows, period_s), _held(rows)


def _insert(seen: _Seen, rows: int, period_s: float) -> Rows:
    """Down where the tip is nearest to a point of the search; off the rim to the next one."""
    points = seen.hole_m + _ring()
    away = np.linalg.norm(points - seen.tcp_m[:2], axis=1)
    number = int(np.argmin(away)) if away.min() < ALIGNED_M else 0
    tip_m = float(seen.tcp_m[2]) - scene.TIP_OFFSET_M - scene.FIXTURE_TOP_M
    if seen.force_n > PRESSED_N and abs(tip_m) < RIM_M:
        return _off_the_rim(seen, points[(number + 1) % len(points)], rows, period_s), _held(rows)
    if tip_m > CLEAR_M and away[number] > ALIGNED_M:
        level = np.append(points[number], seen.tcp_m[2])
        return _straight(seen, level, rows, period_s, CREEP), _held(rows)
    return _down(seen, np.append(points[number], INSERT_Z_M), rows, period_s), _held(rows)


def _off_the_rim(seen: _Seen, aim_m: Array, rows: int, period_s: float) -> Array:
    """Up from where the arm presses to, and then over to a point. Shape (rows, 3).

    The target lies below the arm by what presses over how stiff it is; rows begin there, since a
    leap upward of what it takes is no motion in contact.
    """
    pressed_m = np.array([0.0, 0.0, min(seen.force_n / STIFFNESS_N_M, DEEPEST_M)])
    begin = seen.tcp_m - pressed_m
    height = LIFT_M + pressed_m[2]
    up = _distances(height, 0.0, rows, period_s, CREEP)
    share = np.array([min_jerk((row - 4) / 8) for row in range(rows)])
    over = np.append(aim_m - seen.tcp_m[:2], 0.0)
    return np.asarray(begin + up[:, None] * np.array([0.0, 0.0, 1.0]) + share[:, None] * over)


def _down(seen: _Seen, end_m: Array, rows: int, period_s: float) -> Array:
    """Down to a point, over it within some rows. Shape (rows, 3)."""
    way = float(end_m[2] - seen.tcp_m[2])
    begin = max(0.0, float(seen.velocity_m_s[2]) * np.sign(way))
    gone = np.sign(way) * _distances(abs(way), begin, rows, period_s, DESCENT)
    share = np.array([1.0 - min_jerk((row + 1) / 8) for row in range(rows)])
    beside = end_m[:2] + share[:, None] * (seen.tcp_m[:2] - end_m[:2])
    return np.column_stack([beside, seen.tcp_m[2] + gone])


def _release(seen: _Seen, rows: int, period_s: float) -> Rows:
    """To the bottom, then open where it is."""
    deep = np.append(seen.tcp_m[:2], INSERT_Z_M)
    down = _straight(seen, deep, rows, period_s, DESCENT)
    return down, _opened(seen, rows)


def _retreat(seen: _Seen, rows: int, period_s: float) -> Rows:
    """Straight up with the gripper open."""
    top = np.append(seen.tcp_m[:2], UP_Z_M + scene.TIP_OFFSET_M)
    rising = _straight(seen, top, rows, period_s, RISE)
    return rising, _opened(seen, rows)


_PLANS: dict[str, Callable[[_Seen, int, float], Rows]] = {
    "approach": _approach, "align": _align, "insert": _insert, "release": _release,
    "retreat": _retreat, "recover": _approach,
}  # fmt: skip


def _way(seen: _Seen) -> tuple[float, CubicSpline]:
    """The shorter of the two ways to above the hole; of equal ones that at larger y."""
    ways = [_around(seen, sign) for sign in (1.0, -1.0)]
    return min(ways, key=lambda way: way[0])


def _around(seen: _Seen, sign: float) -> tuple[float, CubicSpline]:
    """Length and points of the way on one side, from where the arm is."""
    x, post_x, side = seen.tcp_m[0], scene.POST_X_M, sign * VIA_M
    corners = (
        []
        if abs(seen.post_y_m - seen.tcp_m[1]) > OUT_OF_THE_WAY_M
        else [
            np.array([post_x - 0.068, seen.post_y_m + 0.72 * side, CRUISE_Z_M]),
            np.array([post_x + 0.005, seen.post_y_m + side, CRUISE_Z_M]),
            np.array([post_x + 0.085, seen.post_y_m + 0.62 * side, CRUISE_Z_M]),
        ]
    )
    ahead = [corner for corner in corners if corner[0] > x + 0.02]
    knots = np.array([seen.tcp_m, *ahead, np.append(seen.hole_m, HOVER_Z_M)])
    chords = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    keep = np.concatenate([[True], chords > 1e-6])
    lengths = np.concatenate([[0.0], np.cumsum(chords[keep[1:]])])
    return float(lengths[-1]), CubicSpline(lengths, knots[keep])


def _straight(seen: _Seen, end_m: Array, rows: int, period_s: float, pace: Pace) -> Array:
    """Straight from where the arm is to a point, at rest there. Shape (rows, 3)."""
    way = end_m - seen.tcp_m
    length = float(np.linalg.norm(way))
    if length < FINE_M:
        return np.repeat(end_m[None], rows, axis=0)
    along = way / length
    begin = max(0.0, float(seen.velocity_m_s @ along))
    gone = _distances(length, begin, rows, period_s, pace)
    return np.asarray(seen.tcp_m + gone[:, None] * along)


def _distances(length: float, begin: float, rows: int, period_s: float, pace: Pace) -> Array:
    """How far along a way of some length each row is, from a speed to rest at its end, m."""
    found, gone, now = np.zeros(rows), 0.0, min(begin, pace.speed_m_s)
    for row in range(rows):
        left = max(length - gone, 0.0)
        stopping = float(np.sqrt(2.0 * pace.acceleration_m_s2 * left))
        now = min(
            now + pace.acceleration_m_s2 * period_s, pace.speed_m_s, stopping, left / period_s
        )
        gone += now * period_s
        found[row] = gone
    return found


def _ring() -> Array:
    """Where the search looks, beside the hole as it is seen: there, then around. (1 + RING, 2)."""
    angles = 2.0 * np.pi * np.arange(RING) / RING
    around = RING_M * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.concatenate([np.zeros((1, 2)), around])


def _held(rows: int) -> Array:
    return np.full(rows, scene.GRASP_OPENING_M)


def _opened(seen: _Seen, rows: int) -> Array:
    """Open within six periods, from where the fingers are."""
    wide = scene.OPEN_OPENING_M - seen.opening_m
    return np.array([seen.opening_m + min_jerk((row + 1) / 6) * wide for row in range(rows)])
