"""Projection: a chunk close by that keeps to rotations, workspace, gripper and rate limits.

Projection repairs rounding and small excess, it does not make a bad chunk good: how much it
changed stands beside the result, and too much is a reason for rejection.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, GRIPPER, POSITION, ROTATION, join_action
from genpolicy.contract.chunk import Projected, Proposal
from genpolicy.contract.rotation import angle_between, rotation_from_6d, rotation_to_6d
from genpolicy.feasibility.context import Context, Workspace
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.feasibility.smoothing import smoothed
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.limits import RobotLimits

Array = NDArray[np.float64]

# Below this relative excess a step counts as within its limit: what was limited once stays.
ROUNDING = 1e-9


def project(
    proposal: Proposal, *, context: Context, settings: FeasibilitySettings, workspace: Workspace
) -> Projected:
    """The geometric part of the projection; a proposal that is no chunk is left as it is.

    In this order: rotation columns to the rotation matrix (Gram-Schmidt), position into the
    workspace, opening into its range, then from the last action on each step to the TCP's speed
    and turning limits. Rows that are late already are not limited in speed.

    Returns:
        Changes are infinite where nothing could be projected; the layers reject such a chunk.
    """
    raw = proposal.actions
    shaped = raw.ndim == 2 and raw.shape[1] == ACTION_DIM and len(raw) > 0
    if not shaped or not np.all(np.isfinite(raw)):
        return Projected(proposal, raw, float("inf"), float("inf"))
    before = rotation_from_6d(raw[:, ROTATION])
    if not np.all(np.isfinite(before)):
        return Projected(proposal, raw, float("inf"), float("inf"))
    rotation = before.copy()
    position = np.clip(raw[:, POSITION], workspace.lower_m, workspace.upper_m)
    opening = np.clip(raw[:, GRIPPER], settings.gripper_lower_m, settings.gripper_upper_m)
    rows = context.rows(len(raw))
    last_position = context.last_action[POSITION]
    last_rotation = rotation_from_6d(context.last_action[ROTATION])
    step_m, turn_rad = _step_limits(settings)
    if _too_fast(position[rows], last_position, step_m):
        position[rows] = _limit_steps(position[rows], last_position, step_m)
    if np.all(np.isfinite(last_rotation)) and _turns_too_fast(
        rotation[rows], last_rotation, turn_rad
    ):
        rotation[rows] = _limit_turns(rotation[rows], last_rotation, turn_rad)
    return _projected(
        proposal, join_action(position, rotation, opening), before=before, after=rotation
    )


def smooth_rates(
    projected: Projected,
    q_rad: Array,
    *,
    context: Context,
    settings: FeasibilitySettings,
    workspace: Workspace,
    kinematics: ArmKinematics,
    limits: RobotLimits,
) -> Iterator[Projected]:
    """The dynamic part: smoothing that keeps the joints within their rate limits, least first.

    Args:
        projected: Result of `project`.
        q_rad: Its inverse kinematics, executable rows only. Shape (n, 7).
        context: State; its commands are the fixed beginning of the path.
        settings: TCP speed limits.
        workspace: Where the smoothed positions must be.
        kinematics: The arm.
        limits: Rate limits that may be used.

    Yields:
        Chunks to choose from; none where no smoothing is needed. The joint path of a chunk is
        not quite the smoothed one (the elbow may differ), so whoever chooses solves it again.
    """
    rows = context.rows(len(projected.actions))
    fixed = np.concatenate([context.q_cmd_history[-2:], context.q_cmd[None]])
    step_m, turn_rad = _step_limits(settings)
    last_rotation = rotation_from_6d(context.last_action[ROTATION])
    before = rotation_from_6d(projected.proposal.actions[:, ROTATION])
    for path in smoothed(q_rad, fixed, limits=limits, period_s=settings.action_period_s):
        position, rotation = kinematics.forward(path)
        inside = np.all((position >= workspace.lower_m) & (position <= workspace.upper_m))
        fast = _too_fast(position, context.last_action[POSITION], step_m)
        if inside and not fast and not _turns_too_fast(rotation, last_rotation, turn_rad):
            actions = projected.actions.copy()
            actions[rows] = join_action(position, rotation, actions[rows, GRIPPER])
            after = before.copy()
            after[rows] = rotation
            yield _projected(projected.proposal, actions, before=before, after=after)


def _projected(proposal: Proposal, actions: Array, *, before: Array, after: Array) -> Projected:
    """The projected chunk with its changes; `before` and `after` are its rotations."""
    moved = np.linalg.norm(actions[:, POSITION] - proposal.actions[:, POSITION], axis=1)
    turned = angle_between(before, after)
    return Projected(proposal, actions, float(np.max(moved)), float(np.max(turned)))


def _step_limits(settings: FeasibilitySettings) -> tuple[float, float]:
    """Most that one action may move (m) and turn (rad)."""
    period_s = settings.action_period_s
    return settings.tcp_speed_limit_m_s * period_s, settings.tcp_turn_limit_rad_s * period_s


def _too_fast(position: Array, last: Array, step_m: float) -> bool:
    steps = np.diff(np.concatenate([last[None], position]), axis=0)
    return bool(np.any(np.linalg.norm(steps, axis=1) > step_m * (1 + ROUNDING)))


def _limit_steps(position: Array, last: Array, step_m: float) -> Array:
    result = position.copy()
    for k in range(len(result)):
        step = result[k] - last
        length = float(np.linalg.norm(step))
        if length > step_m * (1 + ROUNDING):
            result[k] = last + step * (step_m / length)
        last = result[k]
    return result


def _turns_too_fast(rotation: Array, last: Array, turn_rad: float) -> bool:
    before = np.concatenate([last[None], rotation[:-1]])
    return bool(np.any(angle_between(before, rotation) > turn_rad * (1 + ROUNDING)))


def _limit_turns(rotation: Array, last: Array, turn_rad: float) -> Array:
    result = rotation.copy()
    for k in range(len(result)):
        angle = float(angle_between(last, result[k]))
        if angle > turn_rad * (1 + ROUNDING):
            result[k] = _part_of_turn(last, result[k], angle, turn_rad)
        last = result[k]
    return result


def _part_of_turn(first: Array, second: Array, angle_rad: float, part_rad: float) -> Array:
    """Rotation reached after `part_rad` of the turn from first to second (Rodrigues)."""
    relative = first.T @ second
    values, vectors = np.linalg.eigh(relative + relative.T)
    axis = vectors[:, np.argmax(values)]
    skew = np.array(
        [
            relative[2, 1] - relative[1, 2],
            relative[0, 2] - relative[2, 0],
            relative[1, 0] - relative[0, 1],
        ]
    )
    if np.linalg.norm(skew) > 1e-6 * np.sin(max(angle_rad, 1e-3)):
        axis = skew / np.linalg.norm(skew)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(part_rad) * cross + (1 - np.cos(part_rad)) * cross @ cross
    rotated: Array = first @ turn
    columns = rotation_to_6d(rotated)
    return rotation_from_6d(columns)
