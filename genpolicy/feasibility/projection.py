"""Projection: a chunk close by that keeps to rotations, workspace, gripper and rate limits.

Projection repairs rounding and small excess, it does not make a bad chunk good: how much it
changed stands beside the result, and too much is a reason for rejection.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, GRIPPER, POSITION, ROTATION, join_action
from genpolicy.contract.chunk import Projected, Proposal
from genpolicy.contract.rotation import angle_between, rotation_from_6d, rotation_to_6d
from genpolicy.feasibility.arm import FIGURES
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.kernels.chunk import NO_CHUNK, ROUNDING, TURNS, project_all
from genpolicy.feasibility.kernels.smooth import LEFT_ALONE, changes_of, smooth
from genpolicy.feasibility.smoothing import TIGHTENED, ladder
from genpolicy.robot.kinematics import ITERATIONS

Array = NDArray[np.float64]

SOLVER = np.append(FIGURES, ITERATIONS)  # as the kernels take it


def project(proposal: Proposal, *, context: Context, cell: Cell) -> Projected:
    """The geometric part of the projection; a proposal that is no chunk is left as it is.

    In this order: rotation columns to the rotation matrix (Gram-Schmidt), position into the
    workspace, opening into its range, then from the last action on each step to the TCP's speed
    and turning limits. Rows that are late already are not limited in speed.

    Returns:
        Changes are infinite where nothing could be projected; the layers reject such a chunk.
    """
    raw, settings, workspace = proposal.actions, cell.settings, cell.workspace
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
    step_m, turn_rad = _step_limits(cell)
    if _too_fast(position[rows], last_position, step_m):
        position[rows] = _limit_steps(position[rows], last_position, step_m)
    if np.all(np.isfinite(last_rotation)) and _turns_too_fast(
        rotation[rows], last_rotation, turn_rad
    ):
        rotation[rows] = _limit_turns(rotation[rows], last_rotation, turn_rad)
    return _projected(
        proposal, join_action(position, rotation, opening), before=before, after=rotation
    )


def project_many(
    proposals: Sequence[Proposal], contexts: Sequence[Context], cell: Cell
) -> list[Projected]:
    """Both parts of the projection for many proposals, each with its own context.

    The dynamic part smooths least what keeps the joints within their rate limits; a chunk that
    needs no smoothing, or that none helps, is left as it was.
    """
    result = [Projected(p, p.actions, float("inf"), float("inf")) for p in proposals]
    groups: dict[int, list[int]] = defaultdict(list)
    for i, proposal in enumerate(proposals):
        raw = proposal.actions
        if raw.ndim == 2 and raw.shape[1] == ACTION_DIM and len(raw) > 0:
            groups[len(raw)].append(i)
    figures = _figures(cell)
    for members in groups.values():
        raw = np.stack([proposals[i].actions for i in members])
        last = np.stack([contexts[i].last_action for i in members])
        begin = np.array([contexts[i].first_index for i in members])
        actions, changes = np.empty_like(raw), np.empty((len(members), 2))
        state = np.empty(len(members), dtype=np.int64)
        project_all(raw, last, begin, figures, actions, changes, state)
        for place, i in enumerate(members):
            if state[place] == NO_CHUNK:
                continue
            if state[place] == TURNS:
                limited = project(proposals[i], context=contexts[i], cell=cell)
                actions[place] = limited.actions
                changes[place] = limited.position_change_m, limited.rotation_change_rad
            if _smooth(actions[place], contexts[i], cell, figures):
                changes_of(raw[place], actions[place], changes[place])
            result[i] = Projected(proposals[i], actions[place], *changes[place].tolist())
    return result


def _smooth(actions: Array, context: Context, cell: Cell, figures: Array) -> bool:
    """Smooth the rows of a chunk where its joints need it; whether anything was changed."""
    rows = actions[context.first_index :]
    if not len(rows):
        return False
    fixed = np.concatenate([context.q_cmd_history[-2:], context.q_cmd[None]])
    arm, limits = cell.kinematics, cell.usable_limits
    bounds = np.stack([limits.velocity_rad_s, limits.acceleration_rad_s2, limits.jerk_rad_s3])
    rung = smooth(
        arm.turns,
        arm.offsets,
        rows,
        fixed,
        np.array(context.last_action),
        *ladder(len(rows), len(fixed)),
        bounds,
        figures,
        SOLVER,
        np.array([cell.action_period_s, TIGHTENED]),
    )
    return rung != LEFT_ALONE


def _figures(cell: Cell) -> Array:
    """Limits as the kernels take them: workspace, opening, longest step (m), largest turn (rad)."""
    settings, workspace = cell.settings, cell.workspace
    opening = settings.gripper_lower_m, settings.gripper_upper_m
    return np.array([*workspace.lower_m, *workspace.upper_m, *opening, *_step_limits(cell)])


def _projected(proposal: Proposal, actions: Array, *, before: Array, after: Array) -> Projected:
    """The projected chunk with its changes; `before` and `after` are its rotations."""
    moved = np.linalg.norm(actions[:, POSITION] - proposal.actions[:, POSITION], axis=1)
    turned = angle_between(before, after)
    return Projected(proposal, actions, float(np.max(moved)), float(np.max(turned)))


def _step_limits(cell: Cell) -> tuple[float, float]:
    """Most that one action may move (m) and turn (rad)."""
    settings, period_s = cell.settings, cell.action_period_s
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
