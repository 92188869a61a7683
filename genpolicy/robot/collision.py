"""Collision of the arm, what it holds, and the scene: spheres first, FCL where it is close.

A vectorised, conservative test with bounding spheres clears most configurations; FCL decides
the pairs that are left. The swept test is our own, because FCL's continuous query misses hits:
a motion is split until each piece is short, and shapes are inflated by a bound on how far the
motion carries them between two tested configurations.

"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ConfigError
from genpolicy.robot.broadphase import BroadPhase
from genpolicy.robot.frames import Frames
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.narrowphase import NarrowPhase, require_finite
from genpolicy.robot.scene_state import SceneState
from genpolicy.robot.shapes import SceneShapes, shapes_of

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SEGMENT_LENGTH_M = 0.01
DEEPEST_SPLIT = 8


@dataclass(frozen=True)
class Hit:
    """A pair of shapes that touch.

    Attributes:
        row: Which path of the batch.
        index: Action at the end of the motion (0: the first action), or the sample.
        first: Name of the robot's shape.
        second: Name of the other shape.
        depth_m: Penetration as FCL sees it, with clearance and inflation, m.
    """

    row: int
    index: int
    first: str
    second: str
    depth_m: float


@dataclass(frozen=True)
class CollisionReport:
    """Answer for a batch of B paths.

    Attributes:
        hits: First hit found of each path, None where free.
        clearance_m: Lower bound on the distance left beyond the clearance, m; 0 where FCL
            cleared a pair (it says free, not how far); not meaningful for a hit. Shape (B,).
    """

    hits: tuple[Hit | None, ...]
    clearance_m: Array


@dataclass(frozen=True)
class Paths:
    """Batch of joint paths with what each carries and where the scene stands.

    Attributes:
        q_rad: Waypoints. Shape (B, P, J).
        opening_m: Gripper opening at each waypoint, m. Shape (B, P).
        held: The held object is in the hand at the waypoint. Shape (B, P).
        scenes: Scene of each path.
        contact_allowed: The held object may touch the target. Shape (B,).
        clearance_m: Distance that must be left, m, >= 0. Shape (B,).
        asked: Which pairs: `all`, or, of what is held where contact is allowed, all pairs with the
            scene but those with the target (`held`), or all pairs but those (`free`).
    """

    q_rad: Array
    opening_m: Array
    held: BoolArray
    scenes: tuple[SceneState, ...]
    contact_allowed: BoolArray
    clearance_m: Array
    asked: Literal["all", "held", "free"] = "all"


@dataclass(frozen=True)
class _Pieces:
    """Pieces of motion still to be decided.

    Attributes:
        row: Path of each piece. Shape (n,).
        segment: Segment of the path: 0 leads to the first action. Shape (n,).
        q: Joint positions at both ends. Shape (n, 2, J).
        opening: Finger opening at both ends, m. Shape (n, 2).
        held: The object is in the hand at either end of the segment. Shape (n,).
        open: Pairs that are undecided. Shape (n, C).
    """

    row: NDArray[np.int64]
    segment: NDArray[np.int64]
    q: Array
    opening: Array
    held: BoolArray
    open: BoolArray


@dataclass(frozen=True)
class _Ends:
    """Pieces evaluated: frames at the ends, distance bounds at them, travel between. (n, C)."""

    frames: tuple[Frames, Frames]
    bound_m: Array
    travel_m: Array


class CollisionModel:
    """Collision queries for one scene file.

    Args:
        scene_path: The MJCF.
        kinematics: Kinematics of the same file.

    Raises:
        ConfigError: No geom of the robot, or none of the scene, collides.
    """

    def __init__(self, scene_path: Path, kinematics: ArmKinematics) -> None:
        self.kinematics = kinematics
        self.shapes: SceneShapes = shapes_of(
            scene_path, joints=kinematics.joint_count, tcp_site=kinematics.tcp_frame
        )
        if not self.shapes.robot or not self.shapes.scene:
            raise ConfigError(
                where=Path(scene_path).name,
                found=f"with {len(self.shapes.robot)} robot, {len(self.shapes.scene)} scene geoms",
                expected="at least one colliding geom of each",
                action="Put robot geoms in group 1 and scene geoms in group 3.",
            )
        self.broad = BroadPhase(self.shapes)
        self.bodies = self.broad.bodies
        self.narrow = NarrowPhase(self.shapes, self.broad.columns, self.bodies)

    @property
    def self_pair_count(self) -> int:
        """How many pairs of the robot's own shapes are tested against each other."""
        return int(np.sum(self.broad.columns.body < 0))

    def check_samples(self, paths: Paths) -> CollisionReport:
        """Collision at the waypoints 1 to P - 1 of each path (0 is where the arm stands)."""
        batch, points = paths.q_rad.shape[:2]
        require_finite(paths.q_rad, paths.opening_m, paths.clearance_m)
        row, index = (a.ravel() for a in np.indices((batch, points - 1)))
        index = index + 1
        frames = self.kinematics.frames(paths.q_rad[row, index])
        opening = self._opening(paths)[row, index]
        bound = self.broad.lower_bounds(
            self.broad.centres(frames, opening), self.poses(paths.scenes)[row]
        )
        left = bound - paths.clearance_m[row, None]
        enabled = self._enabled(paths, row, paths.held[row, index])
        clearance = np.full(batch, np.inf)
        np.minimum.at(clearance, row, np.min(np.where(enabled, left, np.inf), axis=1))
        hits: list[Hit | None] = [None] * batch
        for i, column in np.argwhere(enabled & ~(left >= 0)):
            r = int(row[i])
            if hits[r] is None:
                hit = self.narrow.test(
                    frames,
                    int(i),
                    opening_m=float(opening[i]),
                    column=int(column),
                    scene=paths.scenes[r],
                    inflation_m=float(paths.clearance_m[r]),
                )
                hits[r] = None if hit is None else Hit(r, int(index[i]) - 1, *hit)
        return CollisionReport(tuple(hits), np.maximum(clearance, 0.0))

    def check_swept(self, paths: Paths) -> CollisionReport:
        """Collision anywhere on the joint-space segments between the waypoints; conservative.

        Source:
            With d the chord of a point over a piece and p'' its second derivative along it, the
            point stays within d / 2 + max|p''| / 8 of the nearer end; |p''| <= reach (sum|dq|)^2.
        """
        require_finite(paths.q_rad, paths.opening_m, paths.clearance_m)
        batch = len(paths.q_rad)
        poses = self.poses(paths.scenes)
        pieces = self._first_pieces(paths)
        hits: list[Hit | None] = [None] * batch
        clearance = np.full(batch, np.inf)
        for depth in range(DEEPEST_SPLIT + 1):
            if not len(pieces.row):
                break
            ends = self._evaluate(pieces, poses)
            left = ends.bound_m - ends.travel_m - paths.clearance_m[pieces.row, None]
            enabled = pieces.open & self._enabled(paths, pieces.row, pieces.held)
            if depth == 0:
                tightest = np.min(np.where(enabled, left, np.inf), axis=1)
                np.minimum.at(clearance, pieces.row, tightest)
            close = enabled & ~(left >= 0)
            split = close & (2 * ends.travel_m > SEGMENT_LENGTH_M)
            split &= depth < DEEPEST_SPLIT
            for i, column in np.argwhere(close & ~split):
                r = int(pieces.row[i])
                if hits[r] is not None:
                    continue
                hit, unsure = self._piece(ends, int(i), int(column), pieces, paths)
                if hit is not None and (not unsure or depth == DEEPEST_SPLIT):
                    hits[r] = Hit(r, int(pieces.segment[i]), *hit)
                split[i, column] = unsure
            split &= np.array([hit is None for hit in hits])[pieces.row, None]
            pieces = _halves(pieces, split)
        return CollisionReport(tuple(hits), np.maximum(clearance, 0.0))

    def in_collision(
        self,
        q_rad: Array,
        scene: SceneState,
        *,
        opening_m: float = 0.0,
        held: bool = True,
        contact_allowed: bool = False,
        clearance_m: float = 0.0,
    ) -> Hit | None:
        """First collision of one configuration of shape (J,), or None."""
        paths = Paths(
            q_rad=np.stack([q_rad, q_rad])[None],
            opening_m=np.full((1, 2), opening_m),
            held=np.full((1, 2), held),
            scenes=(scene,),
            contact_allowed=np.array([contact_allowed]),
            clearance_m=np.array([clearance_m]),
        )
        return self.check_samples(paths).hits[0]

    def placements(self, q_rad: Array, *, opening_m: float) -> list[tuple[Array, Array]]:
        """Rotation and position (m) of every robot shape at one configuration of shape (J,)."""
        frames = self.kinematics.frames(np.asarray(q_rad, dtype=float)[None])
        return [
            self.narrow.placement(frames, 0, opening_m, i) for i in range(len(self.shapes.robot))
        ]

    def scene_placements(self, scene: SceneState) -> list[tuple[Array, Array]]:
        """Rotation and position (m) of every scene shape."""
        return [self.narrow.scene_placement(scene, i) for i in range(len(self.shapes.scene))]

    def _opening(self, paths: Paths) -> Array:
        """Opening of the fingers; around a held object no narrower than it."""
        width = self.shapes.held_half_width_m
        return np.where(paths.held, np.maximum(paths.opening_m, width), paths.opening_m)

    def _enabled(self, paths: Paths, row: NDArray[np.int64], held: BoolArray) -> BoolArray:
        columns = self.broad.columns
        allowed = paths.contact_allowed[row, None]
        enabled: BoolArray = (~columns.held | held[:, None]) & ~(columns.target & allowed)
        if paths.asked != "all":
            touching = columns.held & (columns.body >= 0) & allowed
            enabled &= touching if paths.asked == "held" else ~touching
        return enabled

    def poses(self, scenes: tuple[SceneState, ...]) -> Array:
        """x, y, z (m), cosine and sine of the yaw of each body. Shape (B, bodies, 5)."""
        poses = np.empty((len(scenes), len(self.bodies), 5))
        for i, scene in enumerate(scenes):
            scene.require_known(self.shapes)
            for j, name in enumerate(self.bodies):
                position, yaw = scene.placement(self.shapes, name)
                poses[i, j] = [*position, np.cos(yaw), np.sin(yaw)]
        return poses

    def _first_pieces(self, paths: Paths) -> _Pieces:
        batch, points = paths.q_rad.shape[:2]
        row, segment = (a.ravel() for a in np.indices((batch, points - 1)))
        opening = self._opening(paths)
        return _Pieces(
            row=row,
            segment=segment,
            q=np.stack([paths.q_rad[row, segment], paths.q_rad[row, segment + 1]], axis=1),
            opening=np.stack([opening[row, segment], opening[row, segment + 1]], axis=1),
            held=paths.held[row, segment] | paths.held[row, segment + 1],
            open=np.ones((len(row), len(self.broad.columns.shape)), dtype=bool),
        )

    def _evaluate(self, pieces: _Pieces, poses: Array) -> _Ends:
        frames = [self.kinematics.frames(pieces.q[:, end]) for end in (0, 1)]
        centres = [self.broad.centres(frames[end], pieces.opening[:, end]) for end in (0, 1)]
        bounds = [self.broad.lower_bounds(c, poses[pieces.row]) for c in centres]
        turned = np.sum(np.abs(pieces.q[:, 1] - pieces.q[:, 0]), axis=1)
        opened = np.abs(pieces.opening[:, 1] - pieces.opening[:, 0])
        # A sliding finger on a turning hand bends by its opening times the turn, twice.
        bend = (self.kinematics.reach_m * turned**2 + 2 * opened * turned) / 8
        moved = np.linalg.norm(centres[1] - centres[0], axis=2)
        travel = self.broad.travel(frames[0], frames[1], moved, bend)
        return _Ends((frames[0], frames[1]), np.minimum(*bounds), travel)

    def _piece(
        self, ends: _Ends, i: int, column: int, pieces: _Pieces, paths: Paths
    ) -> tuple[tuple[str, str, float] | None, bool]:
        """Hit of a piece, and whether only the inflation hit, so that splitting may clear it."""
        scene = paths.scenes[int(pieces.row[i])]
        clearance = float(paths.clearance_m[pieces.row[i]])
        inflated = clearance + float(ends.travel_m[i, column])

        def test(end: int, inflation_m: float) -> tuple[str, str, float] | None:
            return self.narrow.test(
                ends.frames[end],
                i,
                opening_m=float(pieces.opening[i, end]),
                column=column,
                scene=scene,
                inflation_m=inflation_m,
            )

        maybe = test(0, inflated) or test(1, inflated)
        if maybe is None:
            return None, False
        sure = test(0, clearance) or test(1, clearance)
        return (maybe, True) if sure is None else (sure, False)


def _halves(pieces: _Pieces, split: BoolArray) -> _Pieces:
    """Both halves of every piece with a pair still undecided; only those pairs stay open."""
    chosen = np.flatnonzero(split.any(axis=1))
    q, opening = pieces.q[chosen], pieces.opening[chosen]
    middle, half_open = q.mean(axis=1), opening.mean(axis=1)
    return _Pieces(
        row=np.concatenate([pieces.row[chosen]] * 2),
        segment=np.concatenate([pieces.segment[chosen]] * 2),
        q=np.concatenate(
            [np.stack([q[:, 0], middle], axis=1), np.stack([middle, q[:, 1]], axis=1)]
        ),
        opening=np.concatenate(
            [
                np.stack([opening[:, 0], half_open], axis=1),
                np.stack([half_open, opening[:, 1]], axis=1),
            ]
        ),
        held=np.concatenate([pieces.held[chosen]] * 2),
        open=np.concatenate([split[chosen]] * 2),
    )
