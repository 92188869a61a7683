"""The reasons of the six layers in words."""

REASON_WORDS: dict[str, str] = {
    "shape": "it is no chunk of the agreed form, or longer than one may be",
    "finite": "a number of it is not a number, or infinite",
    "rotation_degenerate": "six numbers span no rotation",
    "rotation_not_orthonormal": "the columns of a rotation are far from length 1 and a right angle",
    "gripper_range": "the gripper would open or close beyond its range",
    "projection_too_large": "to make it valid, projection had to move or turn it too far",
    "workspace": "the tool leaves the workspace",
    "unreachable": "no joint positions reach the pose",
    "joint_position": "a joint comes too near to the end of its range",
    "singular": "the arm is nearly singular: small motions of the tool need large ones of joints",
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


def said(reason: str) -> str:
    """A reason as a reader writes it."""
    return reason.replace("_", " ")
