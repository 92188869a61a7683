"""What somebody writes first: meshes, one action after the other, nothing kept from the last one.

Per action: inverse kinematics from scratch (from the arm's resting pose, never from the action
before), then every pair of triangle meshes asked of python-fcl, at the action and at `SUB_SAMPLES`
places on the way to it. It ends a configuration at its first touch. Dynamics, contact and freshness
it does not ask at all, so that it is less than what the six layers answer.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import fcl
import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION, ROTATION
from genpolicy.contract.rotation import rotation_from_6d
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.scene_state import SceneState
from genpolicy.robot.shapes import Shape

Array = NDArray[np.float64]

SUB_SAMPLES = 5
SIDES = 24
"""Of what is round; its mesh lies within the shape, by up to 1.7 % of the radius."""
RESTING = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785])


def mesh_of(shape: Shape) -> tuple[Array, NDArray[np.int64]]:
    """Vertices, m, and triangles of a shape, in its own frame. Shapes (V, 3) and (T, 3)."""
    x, y, z = (float(v) for v in shape.half_size_m)
    if shape.kind == "box":
        corners = [(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
        return np.array(corners) * [x, y, z], np.array(triangles)
    if shape.kind == "cylinder":
        return _revolved([(0.0, -z), (x, -z), (x, z), (0.0, z)])
    straight = z if shape.kind == "capsule" else 0.0
    half = np.linspace(-math.pi / 2, 0.0, SIDES // 4 + 1)
    below = [(x * math.cos(a), x * math.sin(a) - straight) for a in half]
    above = [(radius, -height) for radius, height in reversed(below)]
    return _revolved(below + (above if straight else above[1:]))


def _revolved(profile: Iterable[tuple[float, float]]) -> tuple[Array, NDArray[np.int64]]:
    """Rings of `SIDES` vertices at these radii and heights, and what lies between them."""
    around = 2 * math.pi * np.arange(SIDES) / SIDES
    rings = [
        np.column_stack([r * np.cos(around), r * np.sin(around), np.full(SIDES, z)])
        for r, z in profile
    ]
    triangles = []
    for ring in range(len(rings) - 1):
        for side in range(SIDES):
            a, b = ring * SIDES + side, ring * SIDES + (side + 1) % SIDES
            triangles += [(a, b, b + SIDES), (a, b + SIDES, a + SIDES)]
    return np.concatenate(rings), np.array(triangles)


def _object(shape: Shape) -> Any:
    vertices, triangles = mesh_of(shape)
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(triangles))
    model.addSubModel(vertices, triangles)
    model.endModel()
    return fcl.CollisionObject(model)


@dataclass
class Asked:
    """What was done, so that nothing need be multiplied.

    Attributes:
        solved: Poses that were solved.
        configurations: Configurations of which pairs were asked.
    """

    solved: int = 0
    configurations: int = 0


class Straightforward:
    """Judges chunks by kinematics and collision alone.

    Args:
        arm: Kinematics without anything compiled.
        model: Whose shapes and pairs are asked.
        scene: Where bodies stand.
    """

    def __init__(self, arm: ArmKinematics, model: CollisionModel, scene: SceneState) -> None:
        self.asked = Asked()
        self._arm, self._model = arm, model
        self._robot = [_object(shape) for shape in model.shapes.robot]
        self._scene = [_object(shape) for shape in model.shapes.scene]
        for target, (rotation, position) in zip(
            self._scene, model.scene_placements(scene), strict=True
        ):
            target.setTransform(fcl.Transform(rotation, position))
        self._pairs = list(self._named_pairs())

    def _named_pairs(self) -> Iterable[tuple[Any, Any]]:
        columns, model = self._model.broad.columns, self._model
        for shape, body, other in zip(columns.shape, columns.body, columns.other, strict=True):
            if body < 0:
                yield self._robot[shape], self._robot[other]
                continue
            for number, standing in enumerate(model.shapes.scene):
                if standing.body == model.bodies[body]:
                    yield self._robot[shape], self._scene[number]

    def touches(self, q_rad: Array, *, opening_m: float) -> bool:
        """Whether any pair does, at one configuration of shape (J,)."""
        self.asked.configurations += 1
        placements = self._model.placements(q_rad, opening_m=opening_m)
        for target, (rotation, position) in zip(self._robot, placements, strict=True):
            target.setTransform(fcl.Transform(rotation, position))
        request = fcl.CollisionRequest()
        return any(
            fcl.collide(first, second, request, fcl.CollisionResult()) > 0
            for first, second in self._pairs
        )

    def passes(self, actions: Array, *, q_cmd_rad: Array, opening_m: float) -> bool:
        """Whether every action is reached, and nothing touches there or on the way.

        All of a chunk is asked, also behind the first action that fails: a reason with its
        margin names the worst of them.

        Args:
            actions: Shape (K, 10).
            q_cmd_rad: Joints commanded last. Shape (J,).
            opening_m: Of each finger, around what it holds.
        """
        good, before = True, q_cmd_rad
        for action in actions:
            self.asked.solved += 1
            found = self._arm.solve_with_restarts(
                action[None, POSITION],
                rotation_from_6d(action[None, ROTATION]),
                q_seed_rad=RESTING[None],
            )
            q = found.q_rad[0]
            good &= bool(found.converged[0])
            for step in range(1, SUB_SAMPLES + 2):
                way = before + (q - before) * step / (SUB_SAMPLES + 1)
                good &= not self.touches(way, opening_m=opening_m)
            before = q
        return good
