"""The arm and its collisions with their arithmetic compiled; the same answers as `genpolicy.robot`.

Only what is asked for many configurations a chunk is overridden. Which pairs exist, what a hit is,
when a motion is split and what FCL decides is the robot's code, here as there.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.compiled import owned
from genpolicy.feasibility.kernels.arm import place_all, solve_all
from genpolicy.feasibility.kernels.spheres import centres, lower_bounds, travel
from genpolicy.feasibility.kernels.sweep import clear
from genpolicy.feasibility.kernels.torque import torques
from genpolicy.robot import kinematics as robot
from genpolicy.robot.broadphase import BroadPhase
from genpolicy.robot.collision import CollisionModel, CollisionReport, Hit, Paths
from genpolicy.robot.collision import _Ends as Ends
from genpolicy.robot.collision import _Pieces as Pieces
from genpolicy.robot.dynamics import ArmDynamics
from genpolicy.robot.frames import Frames
from genpolicy.robot.kinematics import ArmKinematics, IkResult
from genpolicy.robot.narrowphase import require_finite
from genpolicy.robot.payload import Payload
from genpolicy.robot.scene_state import SceneState
from genpolicy.robot.shapes import SceneShapes

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

FIGURES = np.array([
    robot.DAMPING, robot.STEP_LIMIT_RAD, robot.POSITION_TOLERANCE_M, robot.ROTATION_TOLERANCE_RAD,
])  # fmt: skip


class CompiledArm(ArmKinematics):
    """Kinematics of the arm, row by row."""

    def __init__(self, scene_path: Path) -> None:
        super().__init__(scene_path)
        self.turns, self.offsets = np.array(self._rotations), np.array(self._translations)

    def frames(self, q_rad: Array) -> Frames:
        """Placements of the joints and the TCP; see `ArmKinematics.frames`."""
        n, places = len(q_rad), len(self.turns)
        rotation, position = np.empty((n, places, 3, 3)), np.empty((n, places, 3))
        place_all(self.turns, self.offsets, owned(q_rad), rotation, position)
        return Frames(rotation, position)

    def solve(
        self,
        position_m: Array,
        rotation: Array,
        *,
        q_seed_rad: Array,
        iterations: int = robot.ITERATIONS,
    ) -> IkResult:
        """Joint positions that reach N poses, each alone; see `ArmKinematics.solve`."""
        q = np.array(q_seed_rad, dtype=np.float64, order="C")
        left = np.empty((len(q), 2))
        poses = owned(position_m), owned(rotation)
        solve_all(self.turns, self.offsets, *poses, q, iterations, FIGURES, left)
        converged = (left[:, 0] <= FIGURES[2]) & (left[:, 1] <= FIGURES[3])
        return IkResult(q, converged, left[:, 0], left[:, 1])


class CompiledDynamics(ArmDynamics):
    """Torques of an arm that was compiled, row by row."""

    kinematics: CompiledArm

    def __init__(self, kinematics: CompiledArm, payload: Payload | None = None) -> None:
        super().__init__(kinematics, payload)
        joints = kinematics.joint_count
        self._other = np.zeros((joints + 1, 3))
        self._other[:joints, 0], self._other[:joints, 1] = self._armature, self._damping
        self._other[joints] = self._gravity
        self._bodies = owned(self._mass), owned(self._centre), owned(self._inertia)

    def torque(self, q_rad: Array, dq_rad_s: Array, ddq_rad_s2: Array) -> Array:
        """Torques of the joints that make the arm move like this; see `ArmDynamics.torque`."""
        arm = self.kinematics
        result = np.empty((len(q_rad), arm.joint_count))
        motion = np.stack([q_rad, dq_rad_s, ddq_rad_s2])
        torques(arm.turns, arm.offsets, motion, *self._bodies, self._other, result)
        return result


class CompiledBroadPhase(BroadPhase):
    """Covering spheres and boxes, configuration by configuration."""

    def __init__(self, shapes: SceneShapes) -> None:
        super().__init__(shapes)
        columns = self.columns
        self._pairs_of = np.stack([columns.shape, columns.body, columns.other]).astype(np.int64)
        self._ends = np.append(self._starts, len(self._frame)).astype(np.int64)
        self._size = self._radius[self._starts].copy()
        self._box = np.array([np.concatenate(box) for box in self._boxes])

    @property
    def spheres(self) -> tuple[Integers, Array, Array, Array, Integers, Array, Integers]:
        """Spheres, boxes and pairs, as `sweep.clear` takes them."""
        return (
            self._frame, self._centre, self._slide, self._box, self._ends, self._size,
            self._pairs_of,
        )  # fmt: skip

    def centres(self, frames: Frames, opening_m: Array) -> Array:
        """Centres of all spheres; see `BroadPhase.centres`."""
        result = np.empty((len(opening_m), len(self._frame), 3))
        rotation, position, opening = frames.rotation, frames.position_m, owned(opening_m)
        centres(rotation, position, opening, self._frame, self._centre, self._slide, result)
        return result

    def lower_bounds(self, centres: Array, poses: Array) -> Array:
        """Lower bound on the distance of every pair; see `BroadPhase.lower_bounds`."""
        result = np.empty((len(centres), self._pairs_of.shape[1]))
        own = self._box, self._ends, self._size, self._pairs_of
        lower_bounds(centres, owned(poses), *own, result)
        return result

    def between(
        self, ends: tuple[Frames, Frames], spheres: tuple[Array, Array], bend: Array
    ) -> Array:
        """How far a pair is from the nearer end at most, m; see `BroadPhase.travel`."""
        result = np.empty((len(bend), self._pairs_of.shape[1]))
        turned = ends[0].rotation, ends[1].rotation
        own = self._frame, self._ends, self._size, self._pairs_of
        travel(*turned, *spheres, bend, *own, result)
        return result


class CompiledCollision(CollisionModel):
    """Collision queries of an arm that was compiled."""

    kinematics: CompiledArm
    broad: CompiledBroadPhase

    def __init__(self, scene_path: Path, kinematics: CompiledArm) -> None:
        super().__init__(scene_path, kinematics)
        self.broad = CompiledBroadPhase(self.shapes)

    def check_samples(self, paths: Paths) -> CollisionReport:
        """Collision at the waypoints 1 to P - 1; see `CollisionModel.check_samples`."""
        return self._checked(paths, super().check_samples, swept=False)

    def check_swept(self, paths: Paths) -> CollisionReport:
        """Collision on the segments; see `CollisionModel.check_swept`."""
        return self._checked(paths, super().check_swept, swept=True)

    def poses(self, scenes: tuple[SceneState, ...]) -> Array:
        """Where bodies stand, of each scene once; see `CollisionModel.poses`."""
        first = {id(scene): scene for scene in scenes}
        number = {name: i for i, name in enumerate(first)}
        return super().poses(tuple(first.values()))[[number[id(scene)] for scene in scenes]]

    def _checked(
        self, paths: Paths, exactly: Callable[[Paths], CollisionReport], *, swept: bool
    ) -> CollisionReport:
        """What the spheres alone clear; every path that they do not is asked about exactly."""
        require_finite(paths.q_rad, paths.opening_m, paths.clearance_m)
        least = np.empty(len(paths.q_rad))
        clear(
            self.kinematics.turns, self.kinematics.offsets, owned(paths.q_rad),
            self._opening(paths), np.ascontiguousarray(paths.held), self.poses(paths.scenes),
            self._asked(paths), owned(paths.clearance_m), swept, self.kinematics.reach_m,
            *self.broad.spheres, least,
        )  # fmt: skip
        hits: list[Hit | None] = [None] * len(least)
        close = np.flatnonzero(~(least >= 0))
        if len(close):
            report = exactly(_taken(paths, close))
            least[close] = report.clearance_m
            for i, hit in zip(close.tolist(), report.hits, strict=True):
                hits[i] = None if hit is None else replace(hit, row=i)
        return CollisionReport(tuple(hits), np.maximum(least, 0.0))

    def _asked(self, paths: Paths) -> BoolArray:
        """Pairs that count at a point with an empty hand, and with the object. Shape (B, 2, C)."""
        row = np.repeat(np.arange(len(paths.q_rad)), 2)
        asked = self._enabled(paths, row, np.arange(len(row)) % 2 == 1)
        return asked.reshape(len(paths.q_rad), 2, -1)

    def _evaluate(self, pieces: Pieces, poses: Array) -> Ends:
        """Pieces evaluated; see `CollisionModel._evaluate`."""
        broad, here = self.broad, poses[pieces.row]
        first, second = (self.kinematics.frames(pieces.q[:, end]) for end in (0, 1))
        begin = broad.centres(first, pieces.opening[:, 0])
        end = broad.centres(second, pieces.opening[:, 1])
        bounds = broad.lower_bounds(begin, here), broad.lower_bounds(end, here)
        turned = np.sum(np.abs(pieces.q[:, 1] - pieces.q[:, 0]), axis=1)
        opened = np.abs(pieces.opening[:, 1] - pieces.opening[:, 0])
        bend = (self.kinematics.reach_m * turned**2 + 2 * opened * turned) / 8
        moved = broad.between((first, second), (begin, end), bend)
        return Ends((first, second), np.minimum(*bounds), moved)


def _taken(paths: Paths, rows: Integers) -> Paths:
    """Some of the paths."""
    return Paths(
        q_rad=paths.q_rad[rows],
        opening_m=paths.opening_m[rows],
        held=paths.held[rows],
        scenes=tuple(paths.scenes[i] for i in rows),
        contact_allowed=paths.contact_allowed[rows],
        clearance_m=paths.clearance_m[rows],
        asked=paths.asked,
    )
