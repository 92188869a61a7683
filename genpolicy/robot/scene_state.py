"""Where the movable bodies of the scene stand in one situation."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.robot.shapes import SceneShapes

Array = NDArray[np.float64]

UPRIGHT_TOLERANCE = 1e-9


@dataclass(frozen=True)
class SceneState:
    """Placement of scene bodies by name; a body that is not named stands as in the file.

    What a task's `scene_poses` returns fits.

    Attributes:
        bodies: Position (3,), m, and unit quaternion (4,), w x y z, in the base frame. Bodies
            stand upright: only a turn about z is possible.

    Raises:
        NonFiniteError: A number is not finite.
        ContractError: A body does not stand upright, or the quaternion has no unit length.
    """

    bodies: Mapping[str, tuple[ArrayLike, ArrayLike]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        placed = {}
        for name, (position, quaternion) in self.bodies.items():
            at, turn = np.array(position, dtype=float), np.array(quaternion, dtype=float)
            finite = np.all(np.isfinite(at)) and np.all(np.isfinite(turn))
            if at.shape != (3,) or turn.shape != (4,) or not finite:
                raise NonFiniteError(
                    where=f"SceneState.bodies[{name!r}]",
                    found=f"{at.tolist()}, {turn.tolist()}",
                    expected="a finite position (3,), m, and quaternion (4,)",
                    action="Reject the chunk and hold.",
                )
            tilt = max(abs(turn[1]), abs(turn[2]), abs(float(turn @ turn) - 1.0))
            if not tilt <= UPRIGHT_TOLERANCE:
                raise ContractError(
                    where=f"SceneState.bodies[{name!r}]",
                    found=f"turned by the quaternion {turn.tolist()}",
                    expected="a unit quaternion about z: bodies stand upright",
                    action="Reject the chunk and hold.",
                )
            at.flags.writeable = False
            placed[name] = (at, float(2 * np.arctan2(turn[3], turn[0])))
        object.__setattr__(self, "_placed", placed)

    def placement(self, shapes: SceneShapes, name: str) -> tuple[Array, float]:
        """Position (3,), m, and yaw, rad, of a scene body."""
        placed: dict[str, tuple[Array, float]] = self.__dict__["_placed"]
        return placed[name] if name in placed else shapes.nominal_bodies[name]

    def target_position_m(self, shapes: SceneShapes) -> Array:
        """Centre of the target's opening in the base frame, m; NaN without a target. Shape (3,)."""
        if not shapes.target_body:
            return np.full(3, np.nan)
        position, yaw = self.placement(shapes, shapes.target_body)
        c, s = np.cos(yaw), np.sin(yaw)
        x, y, z = shapes.target_offset_m
        centre: Array = position + np.array([c * x - s * y, s * x + c * y, z])
        return centre

    def require_known(self, shapes: SceneShapes) -> None:
        """Refuse a body that the scene file does not have.

        Raises:
            ContractError: It does not.
        """
        unknown = set(self.bodies) - set(shapes.nominal_bodies)
        if unknown:
            raise ContractError(
                where="SceneState.bodies",
                found=f"naming {sorted(unknown)}",
                expected=f"bodies out of {sorted(shapes.nominal_bodies)}",
                action="Reject the chunk and hold; name bodies as the scene file does.",
            )
