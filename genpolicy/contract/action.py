"""The action: a TCP pose in the robot base frame and a gripper opening, ten numbers.

Every method predicts this representation, and its hash stands in every artifact.
"""

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.rotation import rotation_from_6d, rotation_to_6d
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes

Array = NDArray[np.float64]

ACTION_COMPONENTS = (
    "tcp_x_m", "tcp_y_m", "tcp_z_m",
    "rotation_column_0_x", "rotation_column_0_y", "rotation_column_0_z",
    "rotation_column_1_x", "rotation_column_1_y", "rotation_column_1_z",
    "gripper_opening_m",
)  # fmt: skip
ACTION_DIM = len(ACTION_COMPONENTS)
POSITION = slice(0, 3)
ROTATION = slice(3, 9)
GRIPPER = 9


def action_contract_hash() -> str:
    """SHA-256 of the action's definition."""
    return sha256_bytes(
        canonical_json({"frame": "robot_base", "components": list(ACTION_COMPONENTS), "version": 1})
    )


def join_action(position_m: Array, rotation: Array, gripper_opening_m: Array | float) -> Array:
    """Actions of poses and gripper openings.

    Args:
        position_m: TCP position in the base frame, m. Shape (..., 3).
        rotation: TCP rotation in the base frame. Shape (..., 3, 3).
        gripper_opening_m: Distance of each finger from closed, m. Shape (...).

    Returns:
        Shape (..., 10).
    """
    opening = np.broadcast_to(np.asarray(gripper_opening_m, dtype=float), position_m.shape[:-1])
    return np.concatenate([position_m, rotation_to_6d(rotation), opening[..., None]], axis=-1)


def split_action(action: Array) -> tuple[Array, Array, Array]:
    """Position (m), rotation matrix and gripper opening (m) of actions of shape (..., 10).

    The rotation is all NaN where the six numbers describe none; callers reject it.
    """
    return action[..., POSITION], rotation_from_6d(action[..., ROTATION]), action[..., GRIPPER]
