"""Every threshold of the six layers, with its unit; and the names of the layers.

What a task decides (phases, workspace, robot) and the controller's period are no thresholds: they
come with the cell.
"""

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat

LAYERS = ("representation", "kinematic", "geometric", "dynamic", "contact", "fresh")
"""Layers, in the order in which they decide."""


class FeasibilitySettings(BaseModel):
    """Thresholds of projection and layers; the unit ends the name.

    Attributes:
        maximum_actions: Most actions in a chunk.
        orthonormality_tolerance: Most that raw rotation columns may miss length 1 and a right
            angle by.
        gripper_lower_m: Smallest opening of each finger.
        gripper_upper_m: Largest opening.
        gripper_tolerance_m: Most that a raw opening may leave that range by (then clamped).
        position_change_limit_m: Most that projection may move a position.
        rotation_change_limit_rad: Most that projection may turn a pose.
        position_tolerance_m: Most that inverse kinematics may miss the position by.
        rotation_tolerance_rad: Most that it may miss the rotation by.
        joint_margin_rad: Distance to keep from position limits (MoveIt Servo default).
        condition_limit: Most for the condition number (MoveIt Servo default for a hard stop).
        branch_limit_rad: Most that a joint may turn from a row to the next beyond what the motion
            of the TCP asks for; more is another branch (an elbow or a wrist that flips). Twice what
            a joint of the default task may turn in a period, so that it names what is no motion.
        clearance_m: Distance to keep from everything outside the contact phases.
        contact_clearance_m: The same within the contact phases.
        velocity_factor: Part of the robot's joint velocity limits that may be used.
        acceleration_factor: The same for joint acceleration.
        jerk_factor: The same for joint jerk.
        tcp_speed_limit_m_s: Most for the TCP's speed.
        tcp_turn_limit_rad_s: Most for the TCP's turning rate.
        held_opening_m: Above this opening nothing is held any more.
        release_depth_m: In a contact phase the gripper may also let go once the held object's
            tip is this deep in the target.
        approach_cone_rad: Half angle, about straight down, of motion while holding in contact.
        step_tolerance_m: Lateral or upward part of one action that the cone forgives.
        contact_speed_limit_m_s: Most for the TCP's speed while holding in a contact phase.
        contact_force_limit_n: Most that a command may press what is held into the target, in a
            contact phase; half of what the supervisor of the default task stops at there.
        contact_force_by_phase_n: The same of contact phases that differ.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    maximum_actions: int = Field(default=16, ge=1)
    orthonormality_tolerance: PositiveFloat = 0.2
    gripper_lower_m: float = 0.0
    gripper_upper_m: PositiveFloat = 0.04
    gripper_tolerance_m: PositiveFloat = 0.005
    position_change_limit_m: PositiveFloat = 0.02
    rotation_change_limit_rad: PositiveFloat = 0.1
    position_tolerance_m: PositiveFloat = 1e-6
    rotation_tolerance_rad: PositiveFloat = 1e-6
    joint_margin_rad: float = Field(default=0.1, ge=0)
    condition_limit: PositiveFloat = 30.0
    branch_limit_rad: PositiveFloat = 0.2
    clearance_m: float = Field(default=0.001, ge=0)
    contact_clearance_m: float = Field(default=0.0, ge=0)
    velocity_factor: float = Field(default=0.5, gt=0, le=1)
    acceleration_factor: float = Field(default=0.5, gt=0, le=1)
    jerk_factor: float = Field(default=0.5, gt=0, le=1)
    tcp_speed_limit_m_s: PositiveFloat = 0.5
    tcp_turn_limit_rad_s: PositiveFloat = 1.25
    held_opening_m: PositiveFloat = 0.018
    release_depth_m: PositiveFloat = 0.02
    approach_cone_rad: float = Field(default=0.35, gt=0, lt=1.57)
    step_tolerance_m: float = Field(default=0.003, ge=0)
    contact_speed_limit_m_s: PositiveFloat = 0.15
    contact_force_limit_n: PositiveFloat = 40.0
    contact_force_by_phase_n: dict[str, PositiveFloat] = Field(default_factory=dict)
