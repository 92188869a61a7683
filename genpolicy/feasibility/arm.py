"""The arm and its collisions with their arithmetic compiled; the same answers as `genpolicy.robot`.

Only what is asked for many configurations a chunk is overridden. Which pairs exist, what a hit is,
when a motion is split and what FCL decides is the robot's code, here as there.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.feasibility.kernels.arm import place_all, solve_all
from genpolicy.feasibility.kernels.compiled import owned
from genpolicy.feasibility.kernels.spheres import centres, lower_bounds, travel
from genpolicy.feasibility.kernels.torque import torques
from genpolicy.robot import kinematics as robot
from genpolicy.robot.broadphase import BroadPhase
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.collision import _Ends as Ends
from genpolicy.robot.collision import _Pieces as Pieces
from genpolicy.robot.dynamics import ArmDynamics
from genpolicy.robot.frames import Frames
from genpolicy.robot.kinematics import ArmKinematics, IkResult
from genpolicy.robot.payload import Payload
from genpolicy.robot.shapes import SceneShapes

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

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

    def between(self, ends: tuple[Frames, Frames], spheres: tuple[Array, Array], bend: Array) -> Array:
        """How far a pair is from the nearer end at most, m; see `BroadPhase.travel`."""
        result = np.empty((len(bend), self._pairs_of.shape[1]))
        turned = ends[0].rotation, ends[1].rotation
        own = self._frame, self._ends, self._size, self._pairs_of
        travel(*turned, *spheres, bend, *own, result)
        return result


class CompiledCollision(CollisionModel):
    """Collision queries of an arm that was compiled."""

    broad: CompiledBroadPhase

    def __init__(self, scene_path: Path, kinematics: CompiledArm) -> None:
        super().__init__(scene_path, kinematics)
        self.broad = CompiledBroadPhase(self.shapes)

    def _evaluate(self, pieces: Pieces, poses: Array) -> Ends:
        """Pieces evaluated; see `CollisionModel._evaluate`."""
        broad, (point, begin, end) = self.broad, _points(pieces)
        q, opening = pieces.q.reshape(-1, pieces.q.shape[-1])[point], pieces.opening.ravel()[point]
        frames = self.kinematics.frames(q)
        spheres = broad.centres(frames, opening)
        bounds = broad.lower_bounds(spheres, poses[pieces.row[point // 2]])
        turned = np.sum(np.abs(pieces.q[:, 1] - pieces.q[:, 0]), axis=1)
        opened = np.abs(pieces.opening[:, 1] - pieces.opening[:, 0])
        bend = (self.kinematics.reach_m * turned**2 + 2 * opened * turned) / 8
        first, second = (
            Frames(frames.rotation[at], frames.position_m[at]) for at in (begin, end)
        )
        moved = broad.between((first, second), (spheres[begin], spheres[end]), bend)
        return Ends((first, second), np.minimum(bounds[begin], bounds[end]), moved)


def _points(pieces: Pieces) -> tuple[Integers, Integers, Integers]:
    """Ends that differ, by number (two a piece), and at which of them each piece begins and ends.

    Where a piece goes on from the end of the one before it, that end is looked at once.
    """
    q, opening, row = pieces.q, pieces.opening, pieces.row
    fresh = np.ones((len(row), 2), dtype=bool)
    fresh[1:, 0] = (
        (row[1:] != row[:-1])
        | (q[1:, 0] != q[:-1, 1]).any(axis=1)
        | (opening[1:, 0] != opening[:-1, 1])
    )
    place = np.cumsum(fresh.ravel()).reshape(fresh.shape) - 1
    return np.flatnonzero(fresh.ravel()), place[:, 0], place[:, 1]
