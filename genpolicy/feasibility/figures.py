"""The figures of a cell that the independent checker holds executed rows against."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from genpolicy.feasibility.cell import Cell
from genpolicy.robot.impedance import STIFFNESS_N_M
from genpolicy.verification.contact import ExpectedContact
from genpolicy.verification.motion import ExpectedMotion
from genpolicy.verification.projected import ExpectedProjection

Array = NDArray[np.float64]


def expected_motion(
    robot: Cell,
    seen: Callable[[Array], Array] | None = None,
    placed: Callable[[Array], Mapping[str, tuple[ArrayLike, ArrayLike]]] | None = None,
) -> ExpectedMotion:
    """What the independent checker holds executed rows against: figures, none of the layers.

    Args:
        robot: The cell.
        seen: The task's `action_at`, where observations shall be held against measured states.
        placed: The task's `scene_poses`, where they shall be held against the scene on record.
    """
    limits, settings = robot.usable_limits, robot.settings
    return ExpectedMotion(
        scene_path=robot.kinematics.scene_path,
        workspace_m=np.array([robot.workspace.lower_m, robot.workspace.upper_m]),
        rates=np.stack([limits.velocity_rad_s, limits.acceleration_rad_s2, limits.jerk_rad_s3]),
        arm_rates=np.stack([robot.limits.velocity_rad_s, robot.limits.acceleration_rad_s2]),
        torque_nm=robot.limits.torque_nm,
        tcp_speed_m_s=settings.tcp_speed_limit_m_s,
        tcp_turn_rad_s=settings.tcp_turn_limit_rad_s,
        joint_margin_rad=settings.joint_margin_rad,
        branch_rad=settings.branch_limit_rad,
        condition=settings.condition_limit,
        held_opening_m=settings.held_opening_m,
        contact=ExpectedContact(
            phases=robot.contact_phases,
            opening_phases=robot.opening_phases,
            force_n=robot.force_envelope_n,
            stiffness_n_m=STIFFNESS_N_M,
            speed_m_s=settings.contact_speed_limit_m_s,
            cone_rad=settings.approach_cone_rad,
            forgiven_m=settings.step_tolerance_m,
            release_depth_m=settings.release_depth_m,
        ),
        projection=ExpectedProjection(
            opening_m=(settings.gripper_lower_m, settings.gripper_upper_m),
            beyond_m=settings.gripper_tolerance_m,
            moved_m=settings.position_change_limit_m,
            turned_rad=settings.rotation_change_limit_rad,
        ),
        seen=seen,
        placed=placed,
    )
