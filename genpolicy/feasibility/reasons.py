"""Why a layer rejects: the closed enumeration of reasons, and the units of their margins."""

from enum import StrEnum


class Unit(StrEnum):
    """Unit of a margin."""

    NONE = "1"
    ACTIONS = "actions"
    M = "m"
    RAD = "rad"
    M_OR_RAD = "m or rad"
    S = "s"
    M_S = "m/s"
    RAD_S = "rad/s"
    RAD_S2 = "rad/s^2"
    RAD_S3 = "rad/s^3"
    N = "N"
    NM = "N m"


class Reason(StrEnum):
    """The checks of the six layers, each of which is a reason to reject.

    There is no other reason: the table of checks (`checks.CHECKS`) holds every one of them, in
    this order, with what it measures and the unit of its margin.
    """

    SHAPE = "shape"
    FINITE = "finite"
    ROTATION_DEGENERATE = "rotation_degenerate"
    ROTATION_NOT_ORTHONORMAL = "rotation_not_orthonormal"
    GRIPPER_RANGE = "gripper_range"
    PROJECTION_TOO_LARGE = "projection_too_large"
    WORKSPACE = "workspace"
    UNREACHABLE = "unreachable"
    START_POSE = "start_pose"
    JOINT_POSITION = "joint_position"
    SINGULAR = "singular"
    BRANCH_JUMP = "branch_jump"
    SCENE_COLLISION = "scene_collision"
    SELF_COLLISION = "self_collision"
    SWEPT_COLLISION = "swept_collision"
    MEASURED_COLLISION = "measured_collision"
    ACTION_PERIOD = "action_period"
    JOINT_VELOCITY = "joint_velocity"
    JOINT_ACCELERATION = "joint_acceleration"
    JOINT_JERK = "joint_jerk"
    TCP_SPEED = "tcp_speed"
    TCP_TURN = "tcp_turn"
    JOINT_TORQUE = "joint_torque"
    PAYLOAD_TORQUE = "payload_torque"
    MEASURED_VELOCITY = "measured_velocity"
    MEASURED_ACCELERATION = "measured_acceleration"
    STATE_AGE = "state_age"
    CONTROLLER_MODE = "controller_mode"
    APPROACH_DIRECTION = "approach_direction"
    CONTACT_SPEED = "contact_speed"
    GRIPPER_OPENING = "gripper_opening"
    CONTACT_SURFACE = "contact_surface"
    CONTACT_FORCE = "contact_force"
    SESSION_EPOCH = "session_epoch"
    CALIBRATION_MISMATCH = "calibration_mismatch"
    PHASE_TRANSITION = "phase_transition"
    CHECKPOINT_MISMATCH = "checkpoint_mismatch"
    SAMPLER_MISMATCH = "sampler_mismatch"
    FUTURE_OBSERVATION = "future_observation"
    BEHIND_ACCEPTED = "behind_accepted"
    STALE_OBSERVATION = "stale_observation"
    EXPIRED = "expired"
