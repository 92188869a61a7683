"""Corrupted fixtures: a good chunk with one thing wrong, and the check that must notice it.

Each takes a good case (chunk, context) and returns it broken in one way. Every check has a fixture
that it alone refuses: a checker made without it admits the fixture, which is the evidence that the
check is needed. Where other checks must refuse the same thing, because a way is in collision when
its end is, they are named as standing behind it, and are left out on both sides.

What a task calls its phases and bodies stands in the case.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION
from genpolicy.evidence.shadow import at_the_boundary as boundary
from genpolicy.evidence.shadow import at_the_margin as margin
from genpolicy.evidence.shadow.case import Case, alone, still
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.cell import Cell

Array = NDArray[np.float64]

REST_DEPTH_M = 0.004  # what is held reaches this deep into what it stands on
OVERLAP_M = 0.02  # an obstacle in the way reaches at least this far above the tip of the tool

Applicable = Callable[[Cell, tuple[str, ...]], str]


def always(cell: Cell, obstacles: tuple[str, ...]) -> str:
    """The check is asked of every task."""
    return ""


def in_contact(cell: Cell, obstacles: tuple[str, ...]) -> str:
    """Why the check is asked of no chunk of a task without contact phases; else empty."""
    return "" if cell.contact_phases else "the task has no contact phase"


def with_obstacle(cell: Cell, obstacles: tuple[str, ...]) -> str:
    """Why nothing can be put in the way of a task without obstacles; else empty."""
    return "" if obstacles else "nothing in the task's scene can be put in the way"


def on_a_surface(cell: Cell, obstacles: tuple[str, ...]) -> str:
    """Why what is held cannot stand on anything but the target; else empty."""
    return in_contact(cell, obstacles) or with_obstacle(cell, obstacles) or _holding(cell)


def in_the_target(cell: Cell, obstacles: tuple[str, ...]) -> str:
    """Why nothing can be pressed into a target; else empty."""
    missing = "" if cell.collision.shapes.target_body else "the task's scene has no target"
    return in_contact(cell, obstacles) or _holding(cell) or missing


def _holding(cell: Cell) -> str:
    return "" if cell.collision.shapes.held_reach_m > 0 else "the task's hand holds nothing"


def with_payload(cell: Cell, obstacles: tuple[str, ...]) -> str:
    """Why a task's hand holds nothing that weighs; else empty."""
    return "" if cell.payload is not None else "the task's hand holds nothing"


@dataclass(frozen=True)
class Corruption:
    """One way to break a case.

    Attributes:
        name: Name of the fixture.
        apply: Breaks a case; None where it cannot be broken in this way.
        layer: Layer that must refuse it.
        check: Check that must refuse it; empty where it is only one of several.
        behind: Checks that cannot but refuse it too.
        applicable: From the cell and the task's obstacles, why a task has no such fixture.

    A fixture whose chunk is built anew keeps nothing of the candidate's actions (`built`), so a
    few observations say of it what all of them would.
    """

    name: str
    apply: Callable[[Case, FeasibilityChecker], Case | None]
    layer: str
    check: str = ""
    behind: tuple[str, ...] = ()
    applicable: Applicable = always

    @property
    def built(self) -> bool:
        """Nothing of the candidate's actions is left in it."""
        modules = (margin.__name__, boundary.__name__)
        return self.apply.__module__ in modules or self.apply is leap


def stale_observation(case: Case, _: FeasibilityChecker) -> Case:
    """The chunk arrives after its observation has become too old, but before it expires."""
    late_s = case.context.maximum_age_s + 0.05
    now_s = case.proposal.metadata.condition_observation_event_time_s + late_s
    moved = case.with_metadata(action_start_time_s=now_s, valid_until_s=now_s + 10.0)
    return moved.with_context(
        now_s=now_s, latest_observation_event_time_s=now_s, state_time_s=now_s, first_index=0
    )


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


def other_controller(case: Case, _: FeasibilityChecker) -> Case:
    """The controller is in another mode than the one that the figures are true of."""
    return case.with_context(controller_mode=f"not {case.context.controller_mode}")


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
    actions = case.proposal.actions
    if not np.all(np.isfinite(actions)):
        return None
    actions = checker.project(case.proposal, context=case.context).actions
    rows = case.context.rows(len(actions))
    return _obstructed(
        case, checker, actions[(rows.start + min(rows.stop, len(actions)) - 1) // 2, POSITION]
    )


def leap(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The obstacle stands between where the arm is and the next row, and both are free."""

    def place(leaping: Case) -> Case | None:
        way = np.stack([leaping.context.last_action, leaping.proposal.actions[-1]])
        return _obstructed(leaping, checker, way[:, POSITION].mean(axis=0))

    return margin.leapt_obstacle(case, checker, place)


def _obstructed(case: Case, checker: FeasibilityChecker, middle: Array) -> Case | None:
    """The case with the obstacle at a place (3,) of the TCP; None without one."""
    name = next((body for body in case.obstacles if body in case.poses), None)
    if name is None:
        return None
    position, quaternion = case.poses[name]
    tip_m = middle[2] - checker.collision.shapes.held_reach_m
    lift_m = max(0.0, tip_m + OVERLAP_M - _top_m(name, position, checker))
    at = np.array([middle[0], middle[1], position[2] + lift_m])
    return case.with_body(name, at, quaternion)


def on_another_surface(case: Case, checker: FeasibilityChecker) -> Case | None:
    """In a contact phase, what is held stands in the obstacle's top instead of in the target."""
    name = next((body for body in case.obstacles if body in case.poses), None)
    if name is None or not margin.holding_in_contact(case, checker):
        return None
    here = still(case, checker, case.context.q_cmd)
    place, (position, quaternion) = here.context.last_action[POSITION], case.poses[name]
    tip_m = place[2] - checker.collision.shapes.held_reach_m
    height_m = position[2] + tip_m + REST_DEPTH_M - _top_m(name, position, checker)
    at = np.array([place[0], place[1], height_m])
    there = here.with_body(name, at, quaternion)
    return alone(checker, [there], "contact_surface")


def _top_m(body: str, position: Array, checker: FeasibilityChecker) -> float:
    """Height of a body's highest shape where it stands at a position, m; inf without a shape."""
    own = [s for s in checker.collision.shapes.scene if s.body == body]
    tops = [position[2] + s.position_m[2] + s.half_size_m[2] for s in own]
    return float(max(tops, default=np.inf))


def early_release(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The gripper opens while the object is carried; None where nothing is."""
    settings = checker.settings
    carried = case.context.last_action[GRIPPER] <= settings.held_opening_m
    if not carried or case.context.phase not in case.free_phases:
        return None
    actions = np.array(case.proposal.actions)
    actions[:, GRIPPER] = settings.gripper_upper_m
    return case.with_actions(actions)


CORRUPTIONS = (
    Corruption("too_long", margin.too_long, "representation", "shape"),
    Corruption("not_a_number", not_a_number, "representation"),
    Corruption("late_row_not_a_number", margin.late_row_not_a_number, "representation", "finite"),
    Corruption("infeasible_rotation", infeasible_rotation, "representation"),
    Corruption(
        "late_row_without_rotation", margin.late_row_without_rotation, "representation",
        "rotation_degenerate", ("rotation_not_orthonormal",),
    ),
    Corruption("scaled_rotation", scaled_rotation, "representation", "rotation_not_orthonormal"),
    Corruption(
        "gripper_out_of_range", margin.gripper_out_of_range, "representation", "gripper_range"
    ),
    Corruption("far_ahead", margin.far_ahead, "representation", "projection_too_large"),
    Corruption("outside_workspace", margin.outside_workspace, "kinematic", "workspace"),
    Corruption(
        "out_of_reach", margin.out_of_reach, "kinematic", "unreachable",
        ("workspace", "start_pose", "singular"),
    ),
    Corruption("other_joints", margin.other_joints, "kinematic", "start_pose"),
    Corruption("awkward_posture", margin.awkward_posture, "kinematic", "joint_position"),
    Corruption("singular_posture", margin.singular_posture, "kinematic", "singular"),
    Corruption(
        "flipped_branch", margin.flipped_branch, "kinematic", "branch_jump", margin.SWINGING
    ),
    Corruption(
        "collision", collision, "geometric", "scene_collision",
        ("swept_collision", "measured_collision", "contact_surface"), with_obstacle,
    ),
    Corruption(
        "folded_posture", margin.folded_posture, "geometric", "self_collision",
        margin.OWN_WAY,
    ),
    Corruption("leap", leap, "geometric", "swept_collision", margin.LEAPING, with_obstacle),
    Corruption("cut_off", boundary.cut_off, "geometric", "measured_collision"),
    Corruption("other_period", other_period, "dynamic", "action_period"),
    Corruption("fast_joint", margin.fast_joint, "dynamic", "joint_velocity"),
    Corruption("broken_boundary", boundary.broken_boundary, "dynamic", "joint_acceleration"),
    Corruption("jolt_before", boundary.jolt_before, "dynamic", "joint_jerk"),
    Corruption("fast_tcp", margin.fast_tcp, "dynamic", "tcp_speed"),
    Corruption("fast_turn", margin.fast_turn, "dynamic", "tcp_turn"),
    Corruption(
        "heavy_jolt", boundary.heavy_jolt, "dynamic", "joint_torque",
        ("joint_acceleration", "joint_jerk", "payload_torque"),
    ),
    Corruption(
        "heavy_load", boundary.heavy_load, "dynamic", "payload_torque",
        ("joint_acceleration", "joint_jerk"), with_payload,
    ),
    Corruption("left_behind", boundary.left_behind, "dynamic", "measured_velocity"),
    Corruption("pushed_aside", boundary.pushed_aside, "dynamic", "measured_acceleration"),
    Corruption("old_state", boundary.old_state, "dynamic", "state_age"),
    Corruption("other_controller", other_controller, "dynamic", "controller_mode"),
    Corruption(
        "aside_in_contact", margin.aside_in_contact, "contact", "approach_direction", (), in_contact
    ),
    Corruption(
        "fast_in_contact", margin.fast_in_contact, "contact", "contact_speed", (), in_contact
    ),
    Corruption("early_release", early_release, "contact", "gripper_opening"),
    Corruption(
        "on_another_surface", on_another_surface, "contact", "contact_surface", (), on_a_surface
    ),
    Corruption(
        "pressed_in", margin.pressed_in, "contact", "contact_force", (), in_the_target
    ),
    Corruption("earlier_session", earlier_session, "fresh", "session_epoch"),
    Corruption("calibration_change", calibration_change, "fresh", "calibration_mismatch"),
    Corruption("phase_change", phase_change, "fresh", "phase_transition"),
    Corruption("checkpoint_swap", checkpoint_swap, "fresh", "checkpoint_mismatch"),
    Corruption("sampler_swap", sampler_swap, "fresh", "sampler_mismatch"),
    Corruption("future_observation", future_observation, "fresh", "future_observation"),
    Corruption("reordered_chunk", reordered_chunk, "fresh", "behind_accepted"),
    Corruption("stale_observation", stale_observation, "fresh", "stale_observation"),
    Corruption("expired", expired, "fresh", "expired"),
)  # fmt: skip
"""Every corrupted fixture, in the order of the checks; each check has exactly one of its own."""
