"""The kinematic layer: in the workspace, reachable, off limits and singularity, on one branch?

A chunk says where the motion begins twice: by the joints of the last command and by its pose. All
that is asked of joints begins at the former, and executor and stub, which know no kinematics, hold
the latter against the last command or against where the arm is seen. So the two must be one.

A pose has several joint positions. Each row's are sought from the last command on, and from other
seeds where that fails, so that a row may have an elbow or a wrist on the other side than the row
before it. Such a jump is no motion of the tool, however slowly it were made.
"""

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION, ROTATION
from genpolicy.contract.rotation import angle_between, rotation_from_6d
from genpolicy.feasibility.batch import Batch, Margins
from genpolicy.feasibility.cell import Cell
from genpolicy.robot.frames import pose_error
from genpolicy.robot.kinematics import ArmKinematics

Array = NDArray[np.float64]

POSITION_ROUNDING_M = 1e-9


def margins(batch: Batch, cell: Cell) -> Margins:
    """Margins of the poses and of the joint positions that reach them.

    ==================  =======================================================================
    workspace           min over x, y, z of (p - lower, upper - p), m; rounding of 1 nm is free
    unreachable         min of (tolerance - position error, m) and (tolerance - rotation error,
                        rad) of inverse kinematics
    start_pose          the same of the joints of the last command and its pose
    joint_position      min over joints of (q - lower, upper - q) - joint_margin_rad, rad
    singular            limit - largest over smallest singular value of the TCP Jacobian, 1
    branch_jump         limit - largest turn of a joint from the last command, or the row before,
                        rad; where that is beyond the limit, only the part of the turn that the
                        motion of the TCP does not ask for
    ==================  =======================================================================
    """
    settings, workspace, arm = cell.settings, cell.workspace, cell.kinematics
    position, solution = batch.actions[..., POSITION], batch.solved
    inside = np.minimum(position - workspace.lower_m, np.asarray(workspace.upper_m) - position)
    reach = np.minimum(
        settings.position_tolerance_m - solution.position_error_m,
        settings.rotation_tolerance_rad - solution.rotation_error_rad,
    )
    q = solution.q_rad
    room = np.minimum(q - arm.lower_rad, arm.upper_rad - q)
    condition = arm.condition_number(q.reshape(-1, q.shape[-1])).reshape(q.shape[:2])
    return Margins({
        "workspace": inside.min(axis=(1, 2)) + POSITION_ROUNDING_M,
        "unreachable": reach.min(axis=1),
        "start_pose": _begun(batch, cell),
        "joint_position": room.min(axis=(1, 2)) - settings.joint_margin_rad,
        "singular": settings.condition_limit - condition.max(axis=1),
        "branch_jump": settings.branch_limit_rad - _jumps(batch, cell).max(axis=1),
    })  # fmt: skip


def _begun(batch: Batch, cell: Cell) -> Array:
    """What is left of the tolerances between the last command's joints and its pose. (B,)."""
    settings, told = cell.settings, batch.last_action
    position, rotation = cell.kinematics.forward(batch.q_cmd_rad)
    away_m = np.linalg.norm(position - told[:, POSITION], axis=1)
    turned = angle_between(rotation, rotation_from_6d(told[:, ROTATION]))
    left: Array = np.minimum(
        settings.position_tolerance_m - away_m, settings.rotation_tolerance_rad - turned
    )
    return left


def _jumps(batch: Batch, cell: Cell) -> Array:
    """How far joints turn to each row, rad; of turns beyond the limit what is no motion. (B, n)."""
    path = np.concatenate([batch.q_cmd_rad[:, None], batch.solved.q_rad], axis=1)
    turns: Array = np.max(np.abs(np.diff(path, axis=1)), axis=2)
    chunk, row = np.nonzero((turns > cell.settings.branch_limit_rad) & np.isfinite(turns))
    if len(chunk):
        turns[chunk, row] = _unasked(cell.kinematics, path[chunk, row], path[chunk, row + 1])
    return turns


def _unasked(arm: ArmKinematics, before_rad: Array, after_rad: Array) -> Array:
    """Largest turn of a joint beyond the least joint motion that moves the TCP so. Shape (n,), rad.

    The least motion is that of the Jacobian half-way, so that what it misses of a smooth step is of
    third order. No Jacobian half-way between two branches explains the way from one to the other.
    """
    step = after_rad - before_rad
    way = pose_error(arm.frames(before_rad), *arm.forward(after_rad))
    asked = np.linalg.pinv(arm.jacobian(before_rad + step / 2)) @ way[..., None]
    unasked: Array = np.max(np.abs(step - asked[..., 0]), axis=1)
    return unasked
