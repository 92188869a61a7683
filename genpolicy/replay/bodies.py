"""The cell as primitives of a viewer: links, tool and scene, from the shapes that are checked."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.replay.messages import Colour, Json, cylinder, line, solid
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.outlines import Placed
from genpolicy.robot.scene_state import SceneState
from genpolicy.robot.shapes import HELD, Shape
from genpolicy.tasks.api import Task, Workspace

Array = NDArray[np.float64]

STONE: Colour = (0.55, 0.55, 0.52, 0.9)
TABLE: Colour = (0.80, 0.76, 0.70, 0.6)
TARGET: Colour = (0.20, 0.60, 0.35, 0.9)
ROBOT: Colour = (0.72, 0.76, 0.82, 0.75)
HELD_OBJECT: Colour = (0.90, 0.72, 0.25, 1.0)
EDGE: Colour = (0.4, 0.4, 0.4, 0.6)
HELD_OPENING_M = float(FeasibilitySettings.model_fields["held_opening_m"].default)
"""Above this opening a drawing shows nothing in the hand, m. What was checked is in the journal."""


@dataclass(frozen=True)
class DrawnCell:
    """What a replay draws of a task.

    Attributes:
        collision: Its shapes and where they are.
        workspace: Where the TCP may be.
        obstacles: Bodies that stand in the way.
    """

    collision: CollisionModel
    workspace: Workspace
    obstacles: tuple[str, ...]

    @classmethod
    def of(cls, task: Task) -> "DrawnCell":
        """The cell of a task."""
        kinematics = ArmKinematics(task.scene_path)
        return cls(
            CollisionModel(task.scene_path, kinematics), task.workspace, tuple(task.obstacles)
        )

    def robot(self, q_rad: Array, opening_m: float) -> list[Placed]:
        """Every shape of the robot.

        Args:
            q_rad: Joint positions, rad. Shape (J,).
            opening_m: Opening of the gripper, m.
        """
        shapes = self.collision.shapes
        held = bool(shapes.held_reach_m > 0 and opening_m <= HELD_OPENING_M)
        opening_m = max(opening_m, shapes.held_half_width_m if held else 0.0)
        placements = self.collision.placements(q_rad, opening_m=opening_m)
        return [
            (shape, np.asarray(rotation), np.asarray(position))
            for shape, (rotation, position) in zip(shapes.robot, placements, strict=True)
            if shape.name != HELD or held
        ]

    def tool(self, position_m: Array, rotation: Array, opening_m: float) -> Iterator[Placed]:
        """What hangs behind the last link where the TCP has a pose, reached by joints or not.

        Args:
            position_m: Position of the TCP, m. Shape (3,).
            rotation: Its rotation. Shape (3, 3).
            opening_m: Opening of the gripper, m.
        """
        kinematics = self.collision.kinematics
        q_rad = np.zeros(kinematics.joint_count)  # any: the tool is rigid
        here, turned = kinematics.forward(q_rad)
        for shape, own, place in self.robot(q_rad, opening_m):
            if shape.tool:
                away = rotation @ turned.T
                yield shape, away @ own, position_m + away @ (place - here)

    def scene(self, state: SceneState) -> list[Placed]:
        """Every shape of the scene.

        Raises:
            ContractError: A body that the scene file does not have.
        """
        state.require_known(self.collision.shapes)
        placements = self.collision.scene_placements(state)
        return [
            (shape, np.asarray(rotation), np.asarray(position))
            for shape, (rotation, position) in zip(
                self.collision.shapes.scene, placements, strict=True
            )
        ]

    def look(self, shape: Shape) -> Colour:
        """The colour of a shape by what it is."""
        if shape.name == HELD:
            return HELD_OBJECT
        shapes = self.collision.shapes
        if shape.body not in shapes.nominal_bodies:
            return ROBOT
        if shape.body == shapes.target_body:
            return TARGET
        return STONE if shape.body in self.obstacles else TABLE


def primitives(placed: Iterable[Placed], look: Colour) -> dict[str, list[Json]]:
    """Boxes, cylinders and spheres of shapes in one colour, by their kind in the viewer.

    A capsule is a cylinder with a sphere at each end.
    """
    found: dict[str, list[Json]] = {"cubes": [], "cylinders": [], "spheres": []}
    for shape, rotation, position in placed:
        size = 2 * shape.half_size_m
        if shape.kind == "box":
            found["cubes"].append(solid(position, rotation, size, look))
        elif shape.kind == "sphere":
            found["spheres"].append(solid(position, rotation, size, look))
        else:
            found["cylinders"].append(cylinder(position, rotation, size, look))
        if shape.kind == "capsule":
            end = rotation[:, 2] * shape.half_size_m[2]
            ball = np.full(3, size[0])
            found["spheres"] += [
                solid(position + sign * end, rotation, ball, look) for sign in (-1, 1)
            ]
    return found


def frame_of(workspace: Workspace) -> Json:
    """The twelve edges of the workspace."""
    low, high = np.array(workspace.lower_m), np.array(workspace.upper_m)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij")).reshape(3, 8).T
    pairs = [
        (a, b)
        for i, a in enumerate(corners)
        for b in corners[i + 1 :]
        if np.count_nonzero(a != b) == 1
    ]
    return line(np.array(pairs).reshape(-1, 3), EDGE, width_px=1.0, pairs=True)


def poses_of(bodies: Mapping[str, str]) -> dict[str, tuple[Array, Array]]:
    """Position, m, and quaternion of each body, as a journal writes them."""
    found = {}
    for name, text in bodies.items():
        numbers = np.frombuffer(bytes.fromhex(text), dtype="<f8")
        found[name] = (numbers[:3], numbers[3:])
    return found
