"""Projection: a chunk close by that keeps to rotations, workspace, gripper and rate limits.

Projection repairs rounding and small excess, it does not make a bad chunk good: how much it
changed stands beside the result, and too much is a reason for rejection.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, GRIPPER, POSITION, ROTATION, join_action
from genpolicy.contract.chunk import Projected, Proposal
from genpolicy.contract.rotation import angle_between, rotation_from_6d, rotation_to_6d
from genpolicy.feasibility.batch import Batch
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.smoothing import rate_excess, smoothed

Array = NDArray[np.float64]

# Below this relative excess a step counts as within its limit: what was limited once stays.
ROUNDING = 1e-9


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


def smooth_rates(
    projected: Projected, q_rad: Array, *, context: Context, cell: Cell
) -> Iterator[Projected]:
    """The dynamic part: smoothing that keeps the joints within their rate limits, least first.

    Args:
        projected: Result of `project`.
        q_rad: Its inverse kinematics, executable rows only. Shape (n, J).
        context: State; its commands are the fixed beginning of the path.
        cell: Robot, workspace, and limits of joint and TCP rates.

    Yields:
        Chunks to choose from; none where no smoothing is needed. The joint path of a chunk is
        not quite the smoothed one (the elbow may differ), so whoever chooses solves it again.
    """
    rows = context.rows(len(projected.actions))
    workspace, fixed = cell.workspace, _before(context)
    step_m, turn_rad = _step_limits(cell)
    last_rotation = rotation_from_6d(context.last_action[ROTATION])
    before = rotation_from_6d(projected.proposal.actions[:, ROTATION])
    for path in smoothed(q_rad, fixed, limits=cell.usable_limits, period_s=cell.action_period_s):
        position, rotation = cell.kinematics.forward(path)
        inside = np.all((position >= workspace.lower_m) & (position <= workspace.upper_m))
        fast = _too_fast(position, context.last_action[POSITION], step_m)
        if inside and not fast and not _turns_too_fast(rotation, last_rotation, turn_rad):
            actions = projected.actions.copy()
            actions[rows] = join_action(position, rotation, actions[rows, GRIPPER])
            after = before.copy()
            after[rows] = rotation
            yield _projected(projected.proposal, actions, before=before, after=after)


def project_many(
    proposals: Sequence[Proposal], contexts: Sequence[Context], cell: Cell
) -> list[Projected]:
    """Both parts of the projection for many proposals, each with its own context."""
    result = [project(p, context=c, cell=cell) for p, c in zip(proposals, contexts, strict=True)]
    groups: dict[int, list[int]] = defaultdict(list)
    for i, (chunk, context) in enumerate(zip(result, contexts, strict=True)):
        rows = context.rows(len(chunk.actions))
        if np.isfinite(chunk.position_change_m) and rows.stop > rows.start:
            groups[rows.stop - rows.start].append(i)
    for members in groups.values():
        batch = Batch(tuple(result[i] for i in members), tuple(contexts[i] for i in members))
        for i, chunk in zip(members, _smooth(batch, cell), strict=True):
            result[i] = chunk
    return result


def _smooth(batch: Batch, cell: Cell) -> list[Projected]:
    """Least smoothed chunks whose joint path keeps the rate limits; else as they were."""
    path, reached = _seeded(batch, cell)
    options = {
        i: smooth_rates(chunk, path[i], context=batch.contexts[i], cell=cell)
        for i, chunk in enumerate(batch.projected)
        if reached[i]
    }
    chosen = list(batch.projected)
    while options:
        trial = {i: chunk for i, it in options.items() if (chunk := next(it, None))}
        if not trial:
            break
        tried = Batch(tuple(trial.values()), tuple(batch.contexts[i] for i in trial))
        path, reached = _seeded(tried, cell)
        for place, (i, chunk) in enumerate(trial.items()):
            fixed = _before(batch.contexts[i])
            excess = rate_excess(
                np.concatenate([fixed, path[place]]),
                fixed_points=len(fixed),
                limits=cell.usable_limits,
                period_s=cell.action_period_s,
            )
            if reached[place] and excess <= 1.0:
                chosen[i] = chunk
                del options[i]
        options = {i: it for i, it in options.items() if i in trial}
    return chosen


def _seeded(batch: Batch, cell: Cell) -> tuple[Array, NDArray[np.bool_]]:
    """Inverse kinematics from the last commands, without restarts: (B, n, J) and (B,)."""
    size, rows = batch.actions.shape[:2]
    found = cell.kinematics.solve(
        batch.actions[..., POSITION].reshape(-1, 3),
        batch.rotation.reshape(-1, 3, 3),
        q_seed_rad=np.repeat(batch.q_cmd_rad, rows, axis=0),
    )
    reached = np.array([part.all() for part in found.converged.reshape(size, rows)])
    return found.q_rad.reshape(size, rows, -1), reached


def _before(context: Context) -> Array:
    """The commands that the path goes on from, oldest first. Shape (s, J), 1 <= s <= 3."""
    return np.concatenate([context.q_cmd_history[-2:], context.q_cmd[None]])


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
