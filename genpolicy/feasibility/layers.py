"""The six layers as margins: limit minus value, for a whole batch of chunks at once.

Each function answers for B chunks of n rows with one margin per check and chunk: the smallest
over rows and joints. A margin that cannot be computed is NaN, and NaN never passes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, GRIPPER, POSITION, ROTATION
from genpolicy.contract.chunk import ChunkMetadata, Projected
from genpolicy.contract.rotation import (
    angle_between,
    orthonormality_error,
    rotation_from_6d,
)
from genpolicy.feasibility.context import Context, Workspace
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.limits import RobotLimits
from genpolicy.robot.shapes import SceneShapes

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Margins = dict[str, Array]

PERIOD_TOLERANCE_S = 1e-9
POSITION_ROUNDING_M = 1e-9
ROUNDING = 1e-6  # relative; a step that was limited to its limit must not fail by rounding


@dataclass(frozen=True)
class Batch:
    """Rows of B chunks that can be executed, and what they continue.

    Attributes:
        actions: Projected rows. Shape (B, n, D_a).
        rotation: Shape (B, n, 3, 3).
        last_action: Shape (B, D_a).
        q_cmd_rad: Shape (B, 7).
        contexts: One per chunk.
        metadata: One per chunk.
    """

    actions: Array
    rotation: Array
    last_action: Array
    q_cmd_rad: Array
    contexts: tuple[Context, ...]
    metadata: tuple[ChunkMetadata, ...]

    @property
    def steps_m(self) -> Array:
        """TCP displacement of every action, from the last one on. Shape (B, n, 3)."""
        before = np.concatenate([self.last_action[:, None], self.actions[:, :-1]], axis=1)
        steps: Array = self.actions[..., POSITION] - before[..., POSITION]
        return steps

    def held(self, held_opening_m: float) -> BoolArray:
        """Whether the object is still held: at the last action, then at each row. (B, n + 1)."""
        openings = np.concatenate([self.last_action[:, None], self.actions], axis=1)[..., GRIPPER]
        held: BoolArray = np.logical_and.accumulate(openings <= held_opening_m, axis=1)
        return held


def batch_of(projected: Sequence[Projected], contexts: Sequence[Context]) -> Batch:
    """Batch of chunks with equally many executable rows."""
    rows = [c.rows(len(p.actions)) for p, c in zip(projected, contexts, strict=True)]
    actions = np.stack([p.actions[r] for p, r in zip(projected, rows, strict=True)])
    return Batch(
        actions=actions,
        rotation=rotation_from_6d(actions[..., ROTATION]),
        last_action=np.stack([c.last_action for c in contexts]),
        q_cmd_rad=np.stack([c.q_cmd for c in contexts]),
        contexts=tuple(contexts),
        metadata=tuple(p.metadata for p in projected),
    )


def representation(
    projected: Projected, *, context: Context, settings: FeasibilitySettings
) -> dict[str, float]:
    """Is the raw chunk a chunk at all, and did projection leave it nearly alone?"""
    raw = projected.proposal.actions
    margins: dict[str, float] = {}
    shaped = raw.ndim == 2 and raw.shape[1:] == (ACTION_DIM,)
    rows = range(raw.shape[0])[context.rows(raw.shape[0])] if shaped else range(0)
    room = settings.maximum_actions - (raw.shape[0] if raw.ndim else 0)
    margins["shape"] = float(min(room, len(rows) - 1)) if shaped else -1.0
    if not margins["shape"] >= 0:
        return margins
    margins["finite"] = 0.0 if np.all(np.isfinite(raw)) else float("nan")
    if not margins["finite"] >= 0:
        return margins
    columns = raw[:, ROTATION]
    degenerate = not np.all(np.isfinite(rotation_from_6d(columns)))
    margins["rotation_degenerate"] = float("nan") if degenerate else 0.0
    margins["rotation_not_orthonormal"] = settings.orthonormality_tolerance - float(
        np.max(orthonormality_error(columns))
    )
    opening, slack = raw[:, GRIPPER], settings.gripper_tolerance_m
    margins["gripper_range"] = float(
        min(
            np.min(opening) - settings.gripper_lower_m + slack,
            settings.gripper_upper_m + slack - np.max(opening),
        )
    )
    moved = settings.position_change_limit_m - projected.position_change_m
    turned = settings.rotation_change_limit_rad - projected.rotation_change_rad
    relative = moved / settings.position_change_limit_m, turned / settings.rotation_change_limit_rad
    margins["projection_too_large"] = float(moved if relative[0] <= relative[1] else turned)
    return margins


def kinematic(
    batch: Batch, *, kinematics: ArmKinematics, settings: FeasibilitySettings, workspace: Workspace
) -> tuple[Margins, Array]:
    """Inside the workspace, reachable, away from joint limits and singularities?

    Returns:
        Margins, and the joint positions, shape (B, n, 7), of the last iterate where unreachable.
    """
    position = batch.actions[..., POSITION]
    size, rows = position.shape[:2]
    inside = np.minimum(position - workspace.lower_m, np.asarray(workspace.upper_m) - position)
    q, position_error, rotation_error = solve_chunks(
        kinematics, position, batch.rotation, q_start_rad=batch.q_cmd_rad
    )
    reach = np.minimum(
        settings.position_tolerance_m - position_error,
        settings.rotation_tolerance_rad - rotation_error,
    )
    room = np.minimum(q - kinematics.lower_rad, kinematics.upper_rad - q)
    condition = kinematics.condition_number(q.reshape(-1, q.shape[-1])).reshape(size, rows)
    return {
        "workspace": inside.min(axis=(1, 2)) + POSITION_ROUNDING_M,
        "unreachable": reach.min(axis=1),
        "joint_position": room.min(axis=(1, 2)) - settings.joint_margin_rad,
        "singular": settings.condition_limit - condition.max(axis=1),
    }, q


def solve_chunks(
    kinematics: ArmKinematics, position_m: Array, rotation: Array, *, q_start_rad: Array
) -> tuple[Array, Array, Array]:
    """Inverse kinematics of whole chunks, every row from the chunk's start configuration.

    Each row is a smooth function of its pose, so the differences between rows are those of the
    motion. A chunk with a row that fails is tried again from fixed other seeds, first that row
    alone, so that a hopeless chunk costs little.

    Args:
        kinematics: The arm.
        position_m: Shape (B, n, 3).
        rotation: Shape (B, n, 3, 3).
        q_start_rad: Shape (B, 7).

    Returns:
        Joint positions (B, n, 7), position error (B, n), m, rotation error (B, n), rad.
    """
    size, rows = position_m.shape[:2]
    seeds = np.repeat(q_start_rad, rows, axis=0)
    poses = position_m.reshape(-1, 3), rotation.reshape(-1, 3, 3)
    first = kinematics.solve(*poses, q_seed_rad=seeds)
    q = first.q_rad.copy()
    errors = np.stack([first.position_error_m, first.rotation_error_rad], axis=1)
    good = (first.converged & kinematics.within_limits(q)).reshape(size, rows)
    for chunk in np.flatnonzero(~good.all(axis=1)):
        bad = chunk * rows + np.flatnonzero(~good[chunk])
        for attempt in (bad[:1], bad[1:]):
            again = kinematics.solve_with_restarts(
                poses[0][attempt], poses[1][attempt], q_seed_rad=q_start_rad[[chunk] * len(attempt)]
            )
            q[attempt] = again.q_rad
            errors[attempt] = np.stack([again.position_error_m, again.rotation_error_rad], axis=1)
            if not np.all(again.converged & kinematics.within_limits(again.q_rad)):
                break
    shape = (size, rows)
    return q.reshape(*shape, -1), errors[:, 0].reshape(shape), errors[:, 1].reshape(shape)


def dynamic(
    batch: Batch, q_rad: Array, *, limits: RobotLimits, settings: FeasibilitySettings
) -> Margins:
    """Period, joint velocity, acceleration and jerk from the last commands on, TCP rates.

    Source:
        Backward differences at the action period; `limits` are those that may be used.
    """
    period_s = settings.action_period_s
    off = np.array([abs(m.action_period_s - period_s) for m in batch.metadata])
    margins = {"action_period": PERIOD_TOLERANCE_S - off}
    seams = [c.q_cmd_history for c in batch.contexts]
    names = ("joint_velocity", "joint_acceleration", "joint_jerk")
    bounds = (
        limits.velocity_rad_s,
        limits.acceleration_rad_s2,
        limits.jerk_rad_s3,
    )
    path = np.concatenate([_history(seams), batch.q_cmd_rad[:, None], q_rad], axis=1)
    known = np.array([min(len(s), 2) for s in seams]) + 1 + q_rad.shape[1]
    for order, (name, bound) in enumerate(zip(names, bounds, strict=True), start=1):
        path = np.diff(path, axis=1) / period_s
        # Differences that end at a row of the chunk and rest on given commands only.
        usable = np.minimum(known - order, q_rad.shape[1])
        margins[name] = np.full(len(path), np.inf)
        left = np.min(bound * (1 + ROUNDING) - np.abs(path), axis=2)
        for chunk, count in enumerate(usable):
            if count > 0:
                margins[name][chunk] = left[chunk, -count:].min()
    speed = np.linalg.norm(batch.steps_m, axis=2) / period_s
    margins["tcp_speed"] = settings.tcp_speed_limit_m_s * (1 + ROUNDING) - speed.max(axis=1)
    before = rotation_from_6d(batch.last_action[:, None, ROTATION])
    before = np.concatenate([before, batch.rotation[:, :-1]], axis=1)
    turn = angle_between(before, batch.rotation) / period_s
    margins["tcp_turn"] = settings.tcp_turn_limit_rad_s * (1 + ROUNDING) - turn.max(axis=1)
    return margins


def contact(batch: Batch, *, settings: FeasibilitySettings, shapes: SceneShapes) -> Margins:
    """Towards the target only straight down and slowly; let go only where that is meant.

    Args:
        batch: The chunks.
        settings: Cone, speed and depth.
        shapes: Size of the held object, and where the target opens.
    """
    in_contact = np.array([c.phase in settings.contact_phases for c in batch.contexts])
    held = batch.held(settings.held_opening_m)
    steps = batch.steps_m
    down = np.maximum(-steps[..., 2], 0.0)
    lateral = np.linalg.norm(steps[..., :2], axis=2)
    cone = settings.step_tolerance_m + np.tan(settings.approach_cone_rad) * down - lateral
    upward = settings.step_tolerance_m - np.maximum(steps[..., 2], 0.0)
    direction = np.minimum(cone, upward)
    speed = settings.contact_speed_limit_m_s * (1 + ROUNDING) - (
        np.linalg.norm(steps, axis=2) / settings.action_period_s
    )
    applies = in_contact[:, None] & held[:, 1:]
    return {
        "approach_direction": _smallest(direction, applies),
        "contact_speed": _smallest(speed, applies),
        "gripper_opening": _opening(batch, held, in_contact, settings, shapes),
    }


def _opening(
    batch: Batch,
    held: BoolArray,
    in_contact: BoolArray,
    settings: FeasibilitySettings,
    shapes: SceneShapes,
) -> Array:
    free = np.array([c.phase in settings.opening_phases for c in batch.contexts])
    hole = np.array([c.scene.target_position_m(shapes) for c in batch.contexts])
    depth = hole[:, None, 2] - (batch.actions[..., 2] - shapes.held_reach_m)
    deep = in_contact[:, None] & (depth >= settings.release_depth_m)
    # The moment of letting go: held before, open now.
    opened = held[:, :-1] & ~held[:, 1:]
    wrong = opened & ~deep & ~free[:, None]
    left = settings.held_opening_m - batch.actions[..., GRIPPER]
    return np.where(wrong.any(axis=1), _smallest(left, wrong), 0.0)


def _smallest(margin: Array, applies: BoolArray) -> Array:
    """Smallest margin where it applies; 0 where it applies nowhere; NaN stays. Shape (B,)."""
    smallest: Array = np.min(np.where(applies, margin, np.inf), axis=1)
    return np.where(applies.any(axis=1), smallest, 0.0)


def _history(seams: Sequence[Array]) -> Array:
    """The last two commands before `q_cmd`, padded in front; padding is never used. (B, 2, 7)."""
    result = np.zeros((len(seams), 2, seams[0].shape[1] if len(seams) else 7))
    for chunk, seam in enumerate(seams):
        last = seam[-2:]
        if len(last):
            result[chunk, -len(last) :] = last
    return result
