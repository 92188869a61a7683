"""Where the movable parts of the scene stand in one situation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import NonFiniteError
from genpolicy.robot.shapes import SceneShapes

Array = NDArray[np.float64]

TARGET_BODY, OBSTACLE_BODY = "fixture", "post"


@dataclass(frozen=True)
class SceneState:
    """What may stand elsewhere in another situation; base frame.

    Attributes:
        post_y_m: Lateral position of the obstacle's axis, m.
        hole_position_m: Centre of the target's opening, on its upper face, m. Shape (3,).
        hole_yaw_rad: Yaw of the target, rad.
    """

    post_y_m: float
    hole_position_m: tuple[float, float, float]
    hole_yaw_rad: float

    def __post_init__(self) -> None:
        values = (self.post_y_m, *self.hole_position_m, self.hole_yaw_rad)
        if len(self.hole_position_m) != 3 or not np.all(np.isfinite(values)):
            raise NonFiniteError(
                where="SceneState",
                found=repr(self),
                expected="finite positions (m) and a finite yaw (rad)",
                action="Reject the chunk and hold.",
            )


def body_pose(shapes: SceneShapes, scene: SceneState, name: str) -> tuple[Array, float]:
    """Position (3,), m, and yaw, rad, of a scene body; as in the file where it cannot move."""
    position, yaw = shapes.nominal_bodies[name]
    if name == OBSTACLE_BODY:
        return np.array([position[0], scene.post_y_m, position[2]]), yaw
    if name == TARGET_BODY:
        hole = np.asarray(scene.hole_position_m, dtype=float)
        return hole - [0.0, 0.0, shapes.target_height_m], scene.hole_yaw_rad
    return position, yaw
