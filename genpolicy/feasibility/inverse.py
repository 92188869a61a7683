"""Inverse kinematics of whole chunks, as the kinematic layer and the projection use it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION
from genpolicy.feasibility.batch import Batch, Solution
from genpolicy.feasibility.cell import Cell
from genpolicy.robot.kinematics import ArmKinematics

Array = NDArray[np.float64]


def solved(batch: Batch, cell: Cell) -> Batch:
    """The batch with its joint positions, each chunk from the last command on."""
    solution = solve_chunks(
        cell.kinematics, batch.actions[..., POSITION], batch.rotation, q_start_rad=batch.q_cmd_rad
    )
    return replace(batch, solution=solution)


def solve_chunks(
    kinematics: ArmKinematics, position_m: Array, rotation: Array, *, q_start_rad: Array
) -> Solution:
    """Inverse kinematics of whole chunks, every row from the chunk's start configuration.

    Each row is a smooth function of its pose, so the differences between rows are those of the
    motion. A chunk with a row that fails is tried again from fixed other seeds, first that row
    alone, so that a hopeless chunk costs little.

    Args:
        kinematics: The arm.
        position_m: Shape (B, n, 3).
        rotation: Shape (B, n, 3, 3).
        q_start_rad: Shape (B, J).
    """
    size, rows = position_m.shape[:2]
    seeds = np.repeat(q_start_rad, rows, axis=0)
    poses = position_m.reshape(-1, 3), rotation.reshape(-1, 3, 3)
    first = kinematics.solve(*poses, q_seed_rad=seeds)
    q = first.q_rad.copy()
    errors = np.stack([first.position_error_m, first.rotation_error_rad], axis=1)
    good = (first.converged & kinematics.within_limits(q)).reshape(size, rows)
    for chunk in np.flatnonzero(~good.all(axis=1)):
        bad = chunk * rows + np.flatnonzero(~good[chunk])
        for attempt in (bad[:1], bad[1:]):
            again = kinematics.solve_with_restarts(
                poses[0][attempt], poses[1][attempt], q_seed_rad=q_start_rad[[chunk] * len(attempt)]
            )
            q[attempt] = again.q_rad
            errors[attempt] = np.stack([again.position_error_m, again.rotation_error_rad], axis=1)
            if not np.all(again.converged & kinematics.within_limits(again.q_rad)):
                break
    shape = (size, rows)
    return Solution(q.reshape(*shape, -1), errors[:, 0].reshape(shape), errors[:, 1].reshape(shape))
