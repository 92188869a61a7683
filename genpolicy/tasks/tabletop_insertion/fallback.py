"""Classical plans, jerk-limited, that need no policy: straight up, and back to the start region.

Each segment is one state-to-state problem of Ruckig, solved locally; no intermediate positions.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Result, Ruckig, Trajectory

from genpolicy.contract.action import join_action
from genpolicy.errors import ContractError
from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.phases import INSERT_LEAVE_HEIGHT_M
from genpolicy.tasks.tabletop_insertion.plans import ACTION_PERIOD_S

Array = NDArray[np.float64]

RETREAT, CLASSICAL_RETURN = "retreat", "classical_return"
KINDS = (RETREAT, CLASSICAL_RETURN)

# Limits per axis, far below the arm's own (reliability table: 1.7 m/s, 13 m/s2, 6500 m/s3).
SPEED_M_S = 0.15
ACCELERATION_M_S2 = 0.6
JERK_M_S3 = 6.0
# While the tip may be in the hole or close above it: what is held goes up by less than 3 mm a
# period there, which is what the contact layer allows of any action.
LIFT_SPEED_M_S = 0.05
YAW_SPEED_RAD_S = 0.5
YAW_ACCELERATION_RAD_S2 = 2.0
YAW_JERK_RAD_S3 = 20.0

SAFE_Z_M = 0.165
DETOUR_M = 0.135
START_X_M, START_Z_M = 0.38, 0.15
# Region around the post, in x, in which the hand must not come nearer than the detour.
BLOCKED_X_M = (scene.POST_X_M - 0.085, scene.POST_X_M + 0.085)


def plan(
    kind: str,
    *,
    tcp_m: Array,
    yaw_rad: float,
    gripper_opening_m: float,
    post_y_m: float,
) -> Array:
    """Actions of a fallback from a TCP at rest.

    Args:
        kind: `retreat` (straight up to a safe height, slowly from where the phase may be one of
            contact) or `classical_return` (then around the post, on the side where the hand is, to
            the start region).
        tcp_m: Commanded TCP position, m. Shape (3,).
        yaw_rad: Commanded yaw of the downward-pointing tool.
        gripper_opening_m: Kept as it is.
        post_y_m: Lateral position of the post's axis.

    Returns:
        One action per period, shape (n, 10), n >= 1.

    Raises:
        ContractError: Unknown kind, or Ruckig finds no trajectory.
    """
    if kind not in KINDS:
        raise ContractError(
            where="the kind of fallback",
            found=repr(kind),
            expected=f"one of {list(KINDS)}",
            action="Ask for a plan that the task offers.",
        )
    points = [np.append(tcp_m, yaw_rad)]
    points += [np.array([*corner, yaw_rad]) for corner in _corners(kind, tcp_m, post_y_m)]
    if kind == CLASSICAL_RETURN:
        points[-1][3] = 0.0
    low = float(tcp_m[2]) - scene.TIP_OFFSET_M - scene.FIXTURE_TOP_M < INSERT_LEAVE_HEIGHT_M
    speeds = [LIFT_SPEED_M_S if low else SPEED_M_S] + [SPEED_M_S] * (len(points) - 2)
    parts = [
        _segment(begin, end, speed)
        for (begin, end), speed in zip(pairwise(points), speeds, strict=True)
    ]
    path = np.concatenate(parts)
    rotations = np.stack([scene.tool_rotation(yaw) for yaw in path[:, 3]])
    return join_action(path[:, :3], rotations, gripper_opening_m)


def _corners(kind: str, tcp_m: Array, post_y_m: float) -> list[Array]:
    x, y = float(tcp_m[0]), float(tcp_m[1])
    z = max(float(tcp_m[2]), SAFE_Z_M)
    corners = [np.array([x, y, z])]
    if kind == RETREAT:
        return corners
    side = 1.0 if y >= post_y_m else -1.0
    wide = post_y_m + side * max(DETOUR_M, abs(y - post_y_m))
    if x > BLOCKED_X_M[1]:
        corners.append(np.array([BLOCKED_X_M[1], wide, z]))
    elif x > BLOCKED_X_M[0]:
        corners.append(np.array([x, wide, z]))
    if x > BLOCKED_X_M[0]:
        corners.append(np.array([BLOCKED_X_M[0], wide, z]))
    corners.append(np.array([START_X_M, 0.0, START_Z_M]))
    return corners


def _segment(begin: Array, end: Array, speed_m_s: float) -> Array:
    if np.abs(end - begin).max() < 1e-9:
        return end[None].copy()
    request = InputParameter(4)
    request.current_position = begin.tolist()
    request.target_position = end.tolist()
    request.max_velocity = [speed_m_s] * 3 + [YAW_SPEED_RAD_S]
    request.max_acceleration = [ACCELERATION_M_S2] * 3 + [YAW_ACCELERATION_RAD_S2]
    request.max_jerk = [JERK_M_S3] * 3 + [YAW_JERK_RAD_S3]
    trajectory = Trajectory(4)
    result = Ruckig(4).calculate(request, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise ContractError(
            where="a segment of the fallback",
            found=f"{result} from {begin.tolist()} to {end.tolist()}",
            expected="a jerk-limited trajectory",
            action="Hold and ask a person.",
        )
    periods = int(np.ceil(trajectory.duration / ACTION_PERIOD_S - 1e-9))
    times = np.minimum(ACTION_PERIOD_S * np.arange(1, periods + 1), trajectory.duration)
    return np.array([trajectory.at_time(float(time))[0] for time in times])
