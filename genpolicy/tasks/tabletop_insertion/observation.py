"""What the policy sees of the tabletop insertion cell: 24 numbers from four streams."""

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.observation import Channel, ObservationContract

Array = NDArray[np.float64]

PHASES = ("approach", "align", "insert", "release", "retreat", "recover")
CONTACT_PHASES = frozenset({"insert", "release"})
OPENING_PHASES = frozenset({"release", "retreat"})
FREE_PHASES = frozenset({"approach"})

OBSERVATION = ObservationContract(
    channels=(
        Channel("tcp_position_m", ("x", "y", "z"), "m", "robot", 0.15),
        Channel(
            "tcp_rotation",
            (
                "column_0_x", "column_0_y", "column_0_z",
                "column_1_x", "column_1_y", "column_1_z",
            ),
            "1", "robot", 0.15,
        ),
        Channel("gripper_opening_m", ("opening",), "m", "robot", 0.15),
        Channel("wrench_n", ("x", "y", "z"), "N", "force", 0.15),
        Channel("hole_pose", ("x_m", "y_m", "cos_yaw", "sin_yaw"), "1", "camera", 0.30),
        Channel("post_position_m", ("y",), "m", "camera", 0.30),
        Channel("phase", PHASES, "1", "phase", 0.15),
    )
)  # fmt: skip


def one_hot(phase: str) -> Array:
    """The phase as the numbers of its channel. Shape (6,)."""
    vector = np.zeros(len(PHASES))
    vector[PHASES.index(phase)] = 1.0
    return vector
