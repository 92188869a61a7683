"""The kinematic layer: inside the workspace, reachable, away from joint limits and singularity?"""

import numpy as np

from genpolicy.contract.action import POSITION
from genpolicy.feasibility.batch import Batch, Margins
from genpolicy.feasibility.cell import Cell

POSITION_ROUNDING_M = 1e-9


def margins(batch: Batch, cell: Cell) -> Margins:
    """Margins of the poses and of the joint positions that reach them.

    ==================  =======================================================================
    workspace           min over x, y, z of (p - lower, upper - p), m; rounding of 1 nm is free
    unreachable         min of (tolerance - position error, m) and (tolerance - rotation error,
                        rad) of inverse kinematics
    joint_position      min over joints of (q - lower, upper - q) - joint_margin_rad, rad
    singular            limit - largest over smallest singular value of the TCP Jacobian, 1
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
        "joint_position": room.min(axis=(1, 2)) - settings.joint_margin_rad,
        "singular": settings.condition_limit - condition.max(axis=1),
    })  # fmt: skip
