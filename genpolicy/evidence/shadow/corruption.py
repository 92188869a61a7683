"""Corrupted fixtures: a good chunk with one thing wrong, and the check that must notice it.

Each takes a good case (chunk, context) and returns it broken in one way. Where a fixture names a
check, that check alone stands between it and admission: a checker made without it admits the
fixture, which is the evidence that the check is needed.

What a task calls its phases and bodies stands in the case.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION
from genpolicy.contract.chunk import Proposal
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.context import Context
from genpolicy.robot.scene_state import SceneState

Array = NDArray[np.float64]

OVERLAP_M = 0.02  # an obstacle in the way reaches at least this far above the tip of the tool


@dataclass(frozen=True)
class Case:
    """A chunk and what it is checked against.

    Attributes:
        proposal: The chunk.
        context: State at the check.
        poses: Scene bodies by name, as observed.
        obstacles: Those of them that are only in the way.
        free_phases: The task's phases of motion in the open.
    """

    proposal: Proposal
    context: Context
    poses: dict[str, tuple[Array, Array]]
    obstacles: tuple[str, ...] = ()
    free_phases: frozenset[str] = frozenset()

    def with_actions(self, actions: Array) -> "Case":
        """The case with other actions."""
        return replace(self, proposal=replace(self.proposal, actions=actions))

    def with_metadata(self, **changes: object) -> "Case":
        """The case with other chunk metadata."""
        metadata = replace(self.proposal.metadata, **changes)  # type: ignore[arg-type]
        return replace(self, proposal=replace(self.proposal, metadata=metadata))

    def with_context(self, **changes: object) -> "Case":
        """The case in another context."""
        return replace(self, context=replace(self.context, **changes))  # type: ignore[arg-type]


@dataclass(frozen=True)
class Corruption:
    """One way to break a case.

    Attributes:
        name: Name of the fixture.
        apply: Breaks a case; None where it cannot be broken in this way.
        layer: Layer that must refuse it.
        checks: Checks that, left out together, let it through; empty where others cover it too.
    """

    name: str
    apply: Callable[[Case, FeasibilityChecker], Case | None]
    layer: str
    checks: tuple[str, ...] = ()


def stale_observation(case: Case, _: FeasibilityChecker) -> Case:
    """The chunk arrives after its observation has become too old, but before it expires."""
    late_s = case.context.maximum_age_s + 0.05
    now_s = case.proposal.metadata.condition_observation_event_time_s + late_s
    moved = case.with_metadata(action_start_time_s=now_s, valid_until_s=now_s + 10.0)
    return moved.with_context(now_s=now_s, latest_observation_event_time_s=now_s, first_index=0)


def future_observation(case: Case, _: FeasibilityChecker) -> Case:
    """The chunk claims an observation that nobody has received yet."""
    later_s = case.context.latest_observation_event_time_s + 0.02
    return case.with_metadata(condition_observation_event_time_s=later_s)


def expired(case: Case, _: FeasibilityChecker) -> Case:
    """The chunk's validity ended just before now."""
    return case.with_metadata(valid_until_s=case.context.now_s - 0.001)


def reordered_chunk(case: Case, _: FeasibilityChecker) -> Case:
    """A chunk on a newer observation was accepted before this one arrived."""
    newer_s = case.proposal.metadata.condition_observation_event_time_s + 0.01
    return case.with_context(newest_accepted_observation_s=newer_s)


def phase_change(case: Case, _: FeasibilityChecker) -> Case:
    """The task phase changed while the chunk was on its way."""
    return case.with_metadata(task_phase=f"not {case.context.phase}")


def calibration_change(case: Case, _: FeasibilityChecker) -> Case:
    """The calibration changed while the chunk was on its way."""
    return case.with_metadata(calibration_epoch=f"not {case.context.calibration_epoch}")


def checkpoint_swap(case: Case, _: FeasibilityChecker) -> Case:
    """Other weights made the chunk than those in force."""
    return case.with_metadata(policy_checkpoint_hash="0" * 64)


def sampler_swap(case: Case, _: FeasibilityChecker) -> Case:
    """Another sampler made the chunk than the one in force."""
    return case.with_metadata(sampler_config_hash="0" * 64)


def earlier_session(case: Case, _: FeasibilityChecker) -> Case:
    """The chunk belongs to the session before a reset."""
    return case.with_metadata(session_epoch=case.context.session_epoch - 1)


def other_period(case: Case, _: FeasibilityChecker) -> Case:
    """The chunk was made for another action period than the controller's."""
    return case.with_metadata(action_period_s=case.proposal.metadata.action_period_s * 1.1)


def infeasible_rotation(case: Case, _: FeasibilityChecker) -> Case:
    """In one action the two rotation columns are parallel."""
    actions = np.array(case.proposal.actions)
    row = min(len(actions) - 1, case.context.first_index + 1)
    actions[row, ROTATION] = np.tile(actions[row, ROTATION][:3], 2)
    return case.with_actions(actions)


def scaled_rotation(case: Case, _: FeasibilityChecker) -> Case:
    """The rotation columns are half as long again as they should be."""
    actions = np.array(case.proposal.actions)
    actions[:, ROTATION] *= 1.5
    return case.with_actions(actions)


def not_a_number(case: Case, _: FeasibilityChecker) -> Case:
    """One number of one action is NaN."""
    actions = np.array(case.proposal.actions)
    actions[min(len(actions) - 1, case.context.first_index), 0] = np.nan
    return case.with_actions(actions)


def collision(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The obstacle stands where the projected chunk goes, lifted if too low; None without one."""
    actions, rows = case.proposal.actions, case.context.rows(len(case.proposal.actions))
    name = next((body for body in case.obstacles if body in case.poses), None)
    if name is None or not np.all(np.isfinite(actions)):
        return None
    actions = checker.project(case.proposal, context=case.context).actions
    middle = actions[(rows.start + min(rows.stop, len(actions)) - 1) // 2, POSITION]
    position, quaternion = case.poses[name]
    tip_m = middle[2] - checker.collision.shapes.held_reach_m
    lift_m = max(0.0, tip_m + OVERLAP_M - _top_m(name, position, checker))
    at = np.array([middle[0], middle[1], position[2] + lift_m])
    return case.with_context(scene=SceneState({**case.poses, name: (at, quaternion)}))


def _top_m(body: str, position: Array, checker: FeasibilityChecker) -> float:
    """Height of a body's highest shape where it stands at a position, m; inf without a shape."""
    own = [s for s in checker.collision.shapes.scene if s.body == body]
    tops = [position[2] + s.position_m[2] + s.half_size_m[2] for s in own]
    return float(max(tops, default=np.inf))


def broken_boundary(case: Case, _: FeasibilityChecker) -> Case:
    """The commands before came in so fast that nothing can go on from them without a jolt.

    A chunk that is merely rough is no such case: projection smooths it.
    """
    q_cmd = case.context.q_cmd
    step_rad = np.zeros_like(q_cmd)
    step_rad[0] = 3.0 * case.proposal.metadata.action_period_s
    history = np.stack([q_cmd - 2 * step_rad, q_cmd - step_rad])
    return case.with_context(q_cmd_history=history)


def early_release(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The gripper opens while the object is carried; None where nothing is."""
    settings = checker.settings
    carried = case.context.last_action[GRIPPER] <= settings.held_opening_m
    if not carried or case.context.phase not in case.free_phases:
        return None
    actions = np.array(case.proposal.actions)
    actions[:, GRIPPER] = settings.gripper_upper_m
    return case.with_actions(actions)


def awkward_posture(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The same hand pose, but with a joint at its limit; None where the arm has no such way."""
    if case.context.phase not in case.free_phases:
        return None
    kinematics = checker.kinematics
    position, rotation = kinematics.forward(case.context.q_cmd[None])
    seeds = np.tile(case.context.q_cmd, (64, 1))
    sweep = np.linspace(-2.8, 2.8, num=64)
    seeds[:, 0] += sweep
    seeds[:, 2] -= 1.5 * sweep
    found = kinematics.solve(
        np.repeat(position, 64, axis=0),
        np.repeat(rotation, 64, axis=0),
        q_seed_rad=np.clip(seeds, kinematics.lower_rad, kinematics.upper_rad),
    )
    margin = np.minimum(found.q_rad - kinematics.lower_rad, kinematics.upper_rad - found.q_rad)
    tight = margin.min(axis=1)
    usable = found.converged & (tight > 0.0) & (tight < checker.settings.joint_margin_rad / 2)
    if not usable.any():
        return None
    q = found.q_rad[int(np.flatnonzero(usable)[0])]
    return case.with_context(q_cmd=q, q_meas=q, q_cmd_history=np.zeros((0, len(q))))


CORRUPTIONS = (
    Corruption("stale_observation", stale_observation, "fresh", ("stale_observation",)),
    Corruption("future_observation", future_observation, "fresh", ("future_observation",)),
    Corruption("expired", expired, "fresh", ("expired",)),
    Corruption("reordered_chunk", reordered_chunk, "fresh", ("out_of_order",)),
    Corruption("phase_change", phase_change, "fresh", ("phase_transition",)),
    Corruption("calibration_change", calibration_change, "fresh", ("calibration_mismatch",)),
    Corruption("checkpoint_swap", checkpoint_swap, "fresh", ("checkpoint_mismatch",)),
    Corruption("sampler_swap", sampler_swap, "fresh", ("sampler_mismatch",)),
    Corruption("earlier_session", earlier_session, "fresh", ("reset",)),
    Corruption("other_period", other_period, "dynamic", ("action_period",)),
    Corruption("infeasible_rotation", infeasible_rotation, "representation"),
    Corruption("scaled_rotation", scaled_rotation, "representation", ("rotation_not_orthonormal",)),
    Corruption("not_a_number", not_a_number, "representation"),
    Corruption("collision", collision, "geometric", ("scene_collision", "swept_collision")),
    Corruption("broken_seam", broken_boundary, "dynamic", ("joint_acceleration", "joint_jerk")),
    Corruption("early_release", early_release, "contact", ("gripper_opening",)),
    Corruption("awkward_posture", awkward_posture, "kinematic", ("joint_position",)),
)
"""Every corrupted fixture, with the layer that owns it."""
