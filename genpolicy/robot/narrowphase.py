"""The exact phase of the collision test: FCL, one pair at a time, behind a guard.

FCL answers "free" for NaN, so nothing non-finite and no improper rotation may reach it.
"""

import math
from typing import Any

import fcl
import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.robot.broadphase import Columns
from genpolicy.robot.frames import Frames
from genpolicy.robot.scene_state import SceneState
from genpolicy.robot.shapes import BASE_FRAME, SceneShapes, fcl_geometry

Array = NDArray[np.float64]

INFLATION_STEP_M = 0.00025
ROTATION_TOLERANCE = 1e-6


class NarrowPhase:
    """FCL objects of all shapes; robot shapes also inflated, made when first needed."""

    def __init__(self, shapes: SceneShapes, columns: Columns, bodies: tuple[str, ...]) -> None:
        self.shapes = shapes
        self.columns = columns
        self._members = [
            [i for i, shape in enumerate(shapes.scene) if shape.body == name] for name in bodies
        ]
        self._inflated: dict[tuple[int, int], Any] = {}
        self._plain = [fcl.CollisionObject(fcl_geometry(s, inflation_m=0.0)) for s in shapes.scene]
        self._scene: SceneState | None = None
        self._placed: set[int] = set()

    def test(
        self,
        frames: Frames,
        i: int,
        *,
        opening_m: float,
        column: int,
        scene: SceneState,
        inflation_m: float,
    ) -> tuple[str, str, float] | None:
        """FCL's answer for one pair: names and penetration (m), or None where free."""
        columns = self.columns
        shape, body, other = (int(c[column]) for c in (columns.shape, columns.body, columns.other))
        robot = self._object(shape, inflation_m)
        place(robot, *self.placement(frames, i, opening_m, shape))
        name = self.shapes.robot[shape].name
        if body < 0:
            second = self._object(other, 0.0)
            place(second, *self.placement(frames, i, opening_m, other))
            depth = penetration(robot, second)
            return None if depth is None else (name, self.shapes.robot[other].name, depth)
        for member in self._members[body]:
            depth = penetration(robot, self._scene_object(scene, member))
            if depth is not None:
                return name, self.shapes.scene[member].name, depth
        return None

    def depth_m(
        self, frames: Frames, i: int, *, opening_m: float, column: int, scene: SceneState
    ) -> float:
        """How deep a robot shape lies in any shape of a scene body, m; 0 where it is free."""
        shape, body = int(self.columns.shape[column]), int(self.columns.body[column])
        robot, deepest = self._object(shape, 0.0), 0.0
        place(robot, *self.placement(frames, i, opening_m, shape))
        for member in self._members[body]:
            found = penetration(robot, self._scene_object(scene, member))
            deepest = max(deepest, found or 0.0)
        return deepest

    def placement(
        self, frames: Frames, i: int, opening_m: float, shape: int
    ) -> tuple[Array, Array]:
        """Rotation and position (m) of a robot shape at configuration i of the frames."""
        part = self.shapes.robot[shape]
        local = part.position_m + part.slide * opening_m
        if part.frame == BASE_FRAME:
            return part.rotation, local
        rotation = frames.rotation[i, part.frame]
        return rotation @ part.rotation, frames.position_m[i, part.frame] + rotation @ local

    def scene_placement(self, scene: SceneState, shape: int) -> tuple[Array, Array]:
        """Rotation and position (m) of a scene shape."""
        part = self.shapes.scene[shape]
        position, yaw = scene.placement(self.shapes, part.body)
        c, s = np.cos(yaw), np.sin(yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return turn @ part.rotation, position + turn @ part.position_m

    def _scene_object(self, scene: SceneState, shape: int) -> Any:
        """FCL object of a scene shape where it stands; placed once for as long as one is asked."""
        if scene is not self._scene:
            self._scene, self._placed = scene, set()
        if shape not in self._placed:
            place(self._plain[shape], *self.scene_placement(scene, shape))
            self._placed.add(shape)
        return self._plain[shape]

    def _object(self, shape: int, inflation_m: float) -> Any:
        """FCL object of a robot shape, inflated to the next quarter of a millimetre or more."""
        level = int(np.ceil(inflation_m / INFLATION_STEP_M - 1e-9))
        key = (shape, level)
        if key not in self._inflated:
            geometry = fcl_geometry(self.shapes.robot[shape], inflation_m=level * INFLATION_STEP_M)
            self._inflated[key] = fcl.CollisionObject(geometry)
        return self._inflated[key]


def require_finite(*arrays: Array) -> None:
    """Refuse NaN and infinity before FCL, which would call them free.

    Raises:
        NonFiniteError: A number is not finite.
    """
    for array in arrays:
        if not np.all(np.isfinite(array)):
            raise NonFiniteError(
                where="a collision query",
                found="holding NaN or infinity",
                expected="finite numbers only",
                action="Reject the whole chunk and hold; do not clip or fill it.",
            )


def place(target: Any, rotation: Array, position_m: Array) -> None:
    """Set the placement of an FCL object, and refuse one that FCL would misread.

    Raises:
        NonFiniteError: A number is not finite.
        ContractError: The rotation is none.
    """
    # Numbers one by one: on nine of them NumPy's calls take twenty times as long, and a motion
    # that passes close by asks this thousands of times.
    a, b, c, d, e, f, g, h, i = entries = rotation.ravel().tolist()
    if not all(map(math.isfinite, (*entries, *position_m.tolist()))):
        require_finite(rotation, position_m)
    skew = max(
        abs(a * a + d * d + g * g - 1.0), abs(b * b + e * e + h * h - 1.0),
        abs(c * c + f * f + i * i - 1.0), abs(a * b + d * e + g * h),
        abs(a * c + d * f + g * i), abs(b * c + e * f + h * i),
    )  # fmt: skip
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if not (skew <= ROTATION_TOLERANCE and determinant > 0):
        raise ContractError(
            where="a placement for FCL",
            found=f"not a rotation (error {skew:.1e}, determinant {determinant:.3f})",
            expected="orthonormal with determinant 1",
            action="Reject the whole chunk and hold.",
        )
    target.setTransform(fcl.Transform(rotation, position_m))


def penetration(first: Any, second: Any) -> float | None:
    """Penetration depth of two FCL objects, m, or None where they are apart."""
    result = fcl.CollisionResult()
    request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=True)
    if fcl.collide(first, second, request, result) == 0:
        return None
    depths = [abs(float(contact.penetration_depth)) for contact in result.contacts]
    return max(depths, default=0.0)
