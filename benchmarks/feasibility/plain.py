"""The straightforward way: numpy and FCL of `genpolicy.robot`, projection chunk by chunk.

What is answered with compiled kernels is held against this, by tests and by
`benchmarks.feasibility.equal`.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION, join_action
from genpolicy.contract.chunk import Projected, Proposal
from genpolicy.contract.rotation import rotation_from_6d
from genpolicy.feasibility.batch import Batch
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.checker import LayerChecker
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.projection import (
    _projected,
    _step_limits,
    _too_fast,
    _turns_too_fast,
    project,
)
from genpolicy.feasibility.smoothing import PENALTIES, TIGHTENED, ladder
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.dynamics import ArmDynamics
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.limits import RobotLimits

Array = NDArray[np.float64]


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
    on_path, on_fixed = ladder(len(path), fixed_points)
    candidates = on_path @ path + on_fixed @ fixed
    beginnings = np.broadcast_to(fixed, (len(PENALTIES), *fixed.shape))
    whole = np.concatenate([beginnings, candidates], axis=1)
    used = rate_excess(whole, fixed_points=fixed_points, limits=limits, period_s=period_s)
    for rung in np.flatnonzero(used <= TIGHTENED):
        yield candidates[rung]


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


def plain_cell(cell: Cell) -> Cell:
    """The same cell with nothing compiled in it."""
    arm: Any = ArmKinematics(cell.kinematics.scene_path)
    collision: Any = CollisionModel(arm.scene_path, arm)
    plain = replace(cell, kinematics=arm, collision=collision)
    vars(plain)["dynamics"] = ArmDynamics(arm)
    vars(plain)["loaded_dynamics"] = ArmDynamics(arm, plain.payload)
    return plain


class PlainChecker(LayerChecker):
    """Projection and six layers, the straightforward way."""

    def __init__(self, cell: Cell) -> None:
        super().__init__(plain_cell(cell))

    def project_many(
        self, proposals: Sequence[Proposal], contexts: Sequence[Context]
    ) -> list[Projected]:
        """As the compiled one."""
        return project_many(proposals, contexts, self.cell)
