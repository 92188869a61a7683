"""The broad phase of the collision test: bounding spheres, for whole batches, never too bold.

For every pair that could touch, a lower bound on the distance. Whatever it cannot clear is left
to the exact test; it never clears a pair that touches.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ConfigError
from genpolicy.robot.frames import Frames
from genpolicy.robot.shapes import BASE_FRAME, HELD, SceneShapes, Shape, bounding_spheres

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# Shapes at least this many joints apart along the chain are held against each other. Nearer ones
# touch by design: housings of neighbouring joints overlap in a file of primitives.
SELF_CHAIN_JOINTS = 3


@dataclass(frozen=True)
class Columns:
    """The pairs, one per column: a robot shape against a scene body or another robot shape.

    Attributes:
        shape: Index of the robot shape. Shape (C,).
        body: Index of the scene body, -1 for a self pair. Shape (C,).
        other: Index of the second robot shape of a self pair, else -1. Shape (C,).
        held: The pair involves the held object. Shape (C,).
        target: The pair is the held object against the target. Shape (C,).
    """

    shape: NDArray[np.int64]
    body: NDArray[np.int64]
    other: NDArray[np.int64]
    held: BoolArray
    target: BoolArray


class BroadPhase:
    """Covering spheres of the robot's shapes and boxes around the scene's bodies."""

    def __init__(self, shapes: SceneShapes) -> None:
        self.shapes = shapes
        self.bodies = tuple(shapes.nominal_bodies)
        frames: list[int] = []
        centres, slides, radii, starts = [], [], [], []
        for shape in shapes.robot:
            local, radius = bounding_spheres(shape)
            starts.append(len(frames))
            frames += [shape.frame] * len(local)
            centres.append(local @ shape.rotation.T + shape.position_m)
            slides.append(np.tile(shape.slide, (len(local), 1)))
            radii.append(np.full(len(local), radius))
        self._frame = np.array(frames)
        self._centre = np.concatenate(centres)
        self._slide = np.concatenate(slides)
        self._radius = np.concatenate(radii)
        self._starts = np.array(starts)
        self._boxes = [self._body_box(name) for name in self.bodies]
        self.columns = self._pairs()

    def centres(self, frames: Frames, opening_m: Array) -> Array:
        """Centres of all spheres, m.

        Args:
            frames: Frames of N configurations.
            opening_m: Gripper opening. Shape (N,).

        Returns:
            Shape (N, S, 3).
        """
        result = np.empty((len(opening_m), len(self._frame), 3))
        for frame in np.unique(self._frame):
            members = np.flatnonzero(self._frame == frame)
            local = self._centre[members]
            if frame == BASE_FRAME:
                result[:, members] = local
                continue
            rotation, position = frames.rotation[:, frame], frames.position_m[:, frame]
            placed = (rotation.reshape(-1, 3) @ local.T).reshape(-1, 3, len(members))
            result[:, members] = placed.transpose(0, 2, 1) + position[:, None]
            moving = members[np.any(self._slide[members] != 0, axis=1)]
            if len(moving):
                slide = np.einsum("nij,sj->nsi", rotation, self._slide[moving])
                result[:, moving] += slide * opening_m[:, None, None]
        return result

    def lower_bounds(self, centres: Array, poses: Array) -> Array:
        """Lower bound on the distance of every pair, m; at most 0 where it may touch.

        Args:
            centres: Sphere centres. Shape (N, S, 3).
            poses: x, y, z (m), cosine and sine of the yaw of each body. Shape (N, bodies, 5).

        Returns:
            Shape (N, C).
        """
        per_body = [
            np.minimum.reduceat(
                self._distance_to_box(centres, poses[:, body], self._boxes[body]) - self._radius,
                self._starts,
                axis=1,
            )
            for body in range(len(self.bodies))
        ]
        scene = np.stack(per_body, axis=2)
        columns = self.columns
        own = columns.body < 0
        result = np.empty((len(centres), len(own)))
        result[:, ~own] = scene[:, columns.shape[~own], columns.body[~own]]
        if own.any():
            result[:, own] = self._self_bounds(centres)[:, columns.shape[own], columns.other[own]]
        return result

    def travel(self, first: Frames, second: Frames, moved_m: Array, bend_m: Array) -> Array:
        """How far any point of a pair is from the nearer end of a short motion, at most, m.

        Args:
            first: Frames at one end.
            second: Frames at the other end.
            moved_m: Distance that each sphere's centre moved. Shape (N, S).
            bend_m: Most that a path bends away from its chord. Shape (N,).

        Returns:
            Per pair; of a self pair the sum over both shapes. Shape (N, C).
        """
        turn = np.linalg.norm(first.rotation - second.rotation, axis=(2, 3)) / np.sqrt(2.0)
        turn = np.concatenate([turn[:, :-1], np.zeros((len(turn), 1))], axis=1)  # -1: base
        chord = moved_m + turn[:, self._frame] * self._radius
        per_shape = np.maximum.reduceat(chord, self._starts, axis=1) / 2 + bend_m[:, None]
        total = per_shape[:, self.columns.shape]
        own = np.flatnonzero(self.columns.body < 0)
        total[:, own] += per_shape[:, self.columns.other[own]]
        return total

    def _self_bounds(self, centres: Array) -> Array:
        """Distance bounds between robot shapes; only self pairs are filled. Shape (N, R, R)."""
        count = len(self._starts)
        result = np.full((len(centres), count, count), np.inf)
        ends = np.append(self._starts[1:], len(self._frame))
        own = self.columns.body < 0
        moving, fixed = np.unique(self.columns.shape[own]), np.unique(self.columns.other[own])
        rows = np.concatenate([np.arange(self._starts[i], ends[i]) for i in moving])
        cols = np.concatenate([np.arange(self._starts[i], ends[i]) for i in fixed])
        first, second = centres[:, rows], centres[:, cols]
        squared = np.zeros((len(centres), len(rows), len(cols)))
        for axis in range(3):
            squared += (first[:, :, None, axis] - second[:, None, :, axis]) ** 2
        gap = np.sqrt(squared) - self._radius[rows, None] - self._radius[cols]
        row_starts = np.searchsorted(rows, self._starts[moving])
        col_starts = np.searchsorted(cols, self._starts[fixed])
        gap = np.minimum.reduceat(np.minimum.reduceat(gap, row_starts, axis=1), col_starts, axis=2)
        result[:, moving[:, None], fixed] = gap
        return result

    @staticmethod
    def _distance_to_box(centres: Array, pose: Array, box: tuple[Array, Array]) -> Array:
        middle, half = box
        x = centres[..., 0] - pose[:, None, 0]
        y = centres[..., 1] - pose[:, None, 1]
        cosine, sine = pose[:, None, 3], pose[:, None, 4]
        out_x = np.abs(cosine * x + sine * y - middle[0]) - half[0]
        out_y = np.abs(cosine * y - sine * x - middle[1]) - half[1]
        out_z = np.abs(centres[..., 2] - pose[:, None, 2] - middle[2]) - half[2]
        inside = np.minimum(np.maximum(np.maximum(out_x, out_y), out_z), 0.0)
        squared = (
            np.maximum(out_x, 0.0) ** 2 + np.maximum(out_y, 0.0) ** 2 + np.maximum(out_z, 0.0) ** 2
        )
        distance: Array = np.sqrt(squared) + inside
        return distance

    def _body_box(self, name: str) -> tuple[Array, Array]:
        """Middle and half edges of a box around a scene body's shapes, in its axes, m."""
        lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
        for shape in self.shapes.scene:
            if shape.body != name:
                continue
            half = shape.half_size_m.copy()
            if shape.kind == "capsule":
                half[2] += half[0]
            reach = np.abs(shape.rotation) @ half
            lower = np.minimum(lower, shape.position_m - reach)
            upper = np.maximum(upper, shape.position_m + reach)
        return (lower + upper) / 2, (upper - lower) / 2

    def _pairs(self) -> Columns:
        robot = self.shapes.robot
        pairs = [
            (i, body, -1)
            for i, shape in enumerate(robot)
            if shape.frame != BASE_FRAME
            for body in range(len(self.bodies))
        ]
        own = self_pairs(robot)
        if not own:
            raise ConfigError(
                where="the collision model",
                found="no pair of robot shapes that could meet",
                expected=f"shapes on links {SELF_CHAIN_JOINTS} joints apart along the chain",
                action="Give hand and links colliding geoms of the robot's group in the MJCF.",
            )
        pairs += [(i, -1, j) for i, j in own]
        shape, body, other = np.array(pairs, dtype=np.int64).T
        held = np.array([robot[i].body == HELD for i in shape])
        target = (
            np.array([b >= 0 and self.bodies[b] == self.shapes.target_body for b in body]) & held
        )
        return Columns(shape, body, other, held, target)


def self_pairs(robot: tuple[Shape, ...]) -> list[tuple[int, int]]:
    """Pairs of robot shapes that are held against each other: all that lie far enough apart.

    Links against links, and the tool with what it holds against links. Which pairs follows from
    the kinematic tree alone, never from names.

    Returns:
        Indices of the shape further down the chain and of the one further up.
    """
    return [
        (i, j)
        for i, first in enumerate(robot)
        for j, second in enumerate(robot)
        if first.frame - second.frame >= SELF_CHAIN_JOINTS
    ]
