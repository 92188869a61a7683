"""The reasons of the six layers in words, and their margins in the units of a person."""

from collections.abc import Sequence

REASON_WORDS: dict[str, str] = {
    "shape": "it is no chunk of the agreed form, or longer than one may be",
    "finite": "a number of it is not a number, or infinite",
    "rotation_degenerate": "six numbers span no rotation",
    "rotation_not_orthonormal": "the columns of a rotation are far from length 1 and a right angle",
    "gripper_range": "the gripper would open or close beyond its range",
    "projection_too_large": "to make it valid, projection had to move or turn it too far",
    "workspace": "the tool leaves the workspace",
    "unreachable": "no joint positions reach the pose",
    "start_pose": "the joints that it was checked from are not those of the pose it begins at",
    "joint_position": "a joint comes too near to the end of its range",
    "singular": "the arm is nearly singular: small motions of the tool need large ones of joints",
    "branch_jump": "the arm would swing over to another posture than the tool's motion asks for",
    "scene_collision": "arm, hand or held object comes too near to something, or touches it",
    "self_collision": "the robot comes too near to itself, or touches itself",
    "swept_collision": "on the way between two actions something is touched",
    "measured_collision": "on the way from where the arm was measured something is touched",
    "action_period": "its time between actions is not the controller's",
    "joint_velocity": "a joint would turn too fast",
    "joint_acceleration": "a joint would speed up or brake too hard",
    "joint_jerk": "the acceleration of a joint would change too abruptly",
    "tcp_speed": "the tool would move too fast",
    "tcp_turn": "the tool would turn too fast",
    "joint_torque": "a joint would need too much torque",
    "payload_torque": "a joint would need too much torque with what the hand holds",
    "measured_velocity": "from where the arm was measured, a joint would turn too fast",
    "measured_acceleration": "from how the arm was measured to move, a joint would brake too hard",
    "state_age": "the measured state is too old, or from the future",
    "controller_mode": "the controller is in another mode than the layers speak of",
    "approach_direction": "holding something in contact, it moves sideways or up",
    "contact_speed": "holding something in contact, it moves too fast",
    "gripper_opening": "it lets go where nothing may be let go",
    "contact_surface": "what is held touches, or comes too near to, something but the target",
    "contact_force": "it presses what is held into the target too hard",
    "session_epoch": "it was made before the last reset",
    "calibration_mismatch": "it was made under another calibration",
    "phase_transition": "it was made for another phase",
    "checkpoint_mismatch": "it was made by other weights",
    "sampler_mismatch": "it was made with other sampler settings",
    "future_observation": "it rests on an observation that nobody has received",
    "behind_accepted": "it rests on an older observation than what was accepted since",
    "stale_observation": "the observation under it is too old",
    "expired": "its validity is over",
}
"""What a chunk does that is rejected for it, each as the end of a sentence."""

_CLEARANCE = "clearance to keep"
LIMIT_WORDS: dict[str, str] = {
    "shape": "longest chunk",
    "rotation_not_orthonormal": "largest error",
    "gripper_range": "range of each finger with its tolerance",
    "projection_too_large": "largest change",
    "unreachable": "largest error",
    "start_pose": "largest error",
    "joint_position": "distance to keep from the end",
    "singular": "largest condition number",
    "branch_jump": "largest turn of a joint that the tool's motion does not ask for",
    "scene_collision": _CLEARANCE,
    "self_collision": _CLEARANCE,
    "swept_collision": _CLEARANCE,
    "measured_collision": _CLEARANCE,
    "action_period": "period of the controller",
    "joint_velocity": "limit of a joint",
    "joint_acceleration": "limit of a joint",
    "joint_jerk": "limit of a joint",
    "tcp_speed": "limit of the tool",
    "tcp_turn": "limit of the tool",
    "joint_torque": "limit of a joint",
    "payload_torque": "limit of a joint",
    "measured_velocity": "limit of a joint",
    "measured_acceleration": "limit of a joint",
    "state_age": "oldest state",
    "approach_direction": "sideways or up in one action, besides a cone about straight down",
    "contact_speed": "limit in contact",
    "gripper_opening": "widest opening that still holds",
    "contact_surface": _CLEARANCE,
    "contact_force": "limit of the phase",
    "future_observation": "after what was received",
    "behind_accepted": "before what was accepted",
    "stale_observation": "oldest observation",
    "expired": "after its validity",
}
"""What the limit of a reason is, where it is a number."""

PERSONAL: dict[str, tuple[float, str]] = {
    "1": (1.0, ""),
    "actions": (1.0, "actions"),
    "m": (1e3, "mm"),
    "rad": (57.29577951308232, "°"),
    "s": (1e3, "ms"),
    "m/s": (1e3, "mm/s"),
    "rad/s": (57.29577951308232, "°/s"),
    "rad/s^2": (57.29577951308232, "°/s²"),
    "rad/s^3": (57.29577951308232, "°/s³"),
    "N": (1.0, "N"),
    "N m": (1.0, "N m"),
}
"""Factor and name of the unit in which a person reads a margin, by the unit of the evidence."""


def said(reason: str) -> str:
    """A reason as a reader writes it."""
    return reason.replace("_", " ")


def personal(values: Sequence[float], unit: str) -> str:
    """A quantity in the unit of a person: one number, or the range of several.

    Raises:
        KeyError: No such unit.
    """
    factor, name = PERSONAL[unit]
    low, high = factor * min(values), factor * max(values)
    text = _three(low) if low == high else f"{_three(low)} to {_three(high)}"
    space = "" if not name or name.startswith("°") else " "
    return f"{text}{space}{name}"


def _three(value: float) -> str:
    """Three digits that count, and no powers of ten where a person would write none."""
    text = f"{float(f'{value:.3g}'):,.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return text.replace("-", "−")
