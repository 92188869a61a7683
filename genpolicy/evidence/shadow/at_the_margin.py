"""Corruptions at the margin of one check of posture, of motion in progress or of contact.

Each says where the arm could stand or go so that its check alone refuses the chunk, and takes the
first such place of which that is true; None where there is none.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION, join_action
from genpolicy.evidence.shadow.case import Case, alone, moving, still
from genpolicy.evidence.shadow.postures import directions, joint_steps, postures_of, step_of
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.robot.collision import Paths
from genpolicy.robot.impedance import STIFFNESS_N_M
from genpolicy.robot.pressing import pressed_depth_m

Array = NDArray[np.float64]
Place = Callable[[Case], Case | None]

RATES = ("joint_velocity", "joint_acceleration", "joint_jerk", "tcp_speed", "tcp_turn")
# A leap is too fast, and so is the way to it, which leads through the same.
LEAPING = (*RATES, "measured_velocity", "measured_collision")

# What swings over turns as no joint can, and by a way that nobody looked at.
SWINGING = (
    *RATES, "joint_torque", "payload_torque", "measured_velocity", "measured_acceleration",
    "swept_collision", "measured_collision",
)  # fmt: skip
OWN_WAY = ("workspace", "swept_collision", "measured_collision")

BEYOND = 1.02  # of a limit
WITHIN = 0.98
# Times the depth at which what is held is pressed too hard.
DEEPER = np.array([1.0, 1.15, 1.3, 1.5])
ASIDE_M = (0.01, 0.02, 0.03, 0.04)  # beside the target's middle
LEAPS = (4, 6, 8, 10)  # times the fastest step
OTHER_RAD = 0.002  # a millimetre at the TCP, and a step that no rate refuses


def too_long(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm is told to stay where it is, by one row more than a chunk may have."""
    rows = checker.settings.maximum_actions + 1 - case.context.first_index
    return still(case, checker, case.context.q_cmd, rows=rows)


def late_row_not_a_number(case: Case, checker: FeasibilityChecker) -> Case | None:
    """A number is NaN in a row that is late already, so that nothing else would ever read it."""
    return _late_row(case, checker, slice(0, 1), np.nan)


def late_row_without_rotation(case: Case, checker: FeasibilityChecker) -> Case | None:
    """A row that is late already has six zeros for a rotation."""
    return _late_row(case, checker, ROTATION, 0.0)


def _late_row(case: Case, checker: FeasibilityChecker, columns: slice, value: float) -> Case:
    late = case.with_context(first_index=max(1, case.context.first_index))
    here = still(late, checker, late.context.q_cmd)
    actions = np.array(here.proposal.actions)
    actions[0, columns] = value
    return here.with_actions(actions).as_it_is()


def gripper_out_of_range(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The gripper is told to close or open by more than its range and the tolerance."""
    settings, here = checker.settings, still(case, checker, case.context.q_cmd)
    cases = []
    for opening_m in (
        settings.gripper_lower_m - BEYOND * settings.gripper_tolerance_m,
        settings.gripper_upper_m + BEYOND * settings.gripper_tolerance_m,
    ):
        actions = np.array(here.proposal.actions)
        actions[:, GRIPPER] = opening_m
        cases.append(here.with_actions(actions))
    return alone(checker, cases, "gripper_range")


def far_ahead(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The next row is so far ahead that projection must bring it back by more than it may."""
    settings, cell = checker.settings, checker.cell
    step_m = settings.tcp_speed_limit_m_s * cell.action_period_s
    cases = []
    for way in directions():
        ahead = _going(case, checker, linear_m=WITHIN * step_m * way)
        actions = np.array(ahead.proposal.actions)
        excess_m = BEYOND * settings.position_change_limit_m + (1 - WITHIN) * step_m
        actions[-1, POSITION] += excess_m * way
        cases.append(ahead.with_actions(actions))
    return alone(checker, cases, "projection_too_large")


def outside_workspace(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm stands still just outside the workspace, and projection leaves it there."""
    cases = [still(case, checker, q).as_it_is() for q in postures_of(checker.cell).outside]
    return alone(checker, cases, "workspace")


def out_of_reach(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm is stretched out towards a place that it cannot reach, and told to go on there.

    It is badly conditioned there, outside the workspace, and its last command is out of reach, too.
    """
    cases = []
    for q_rad, place in postures_of(checker.cell).stretched:
        action = join_action(*place, case.context.last_action[GRIPPER])
        there = still(case, checker, q_rad)
        actions = np.tile(action, (len(there.proposal.actions), 1))
        cases.append(there.with_context(last_action=action).with_actions(actions).as_it_is())
    return alone(checker, cases, "unreachable", ("workspace", "start_pose", "singular"))


def other_joints(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm stands still, and the joints that the chunk is checked from put it elsewhere.

    The pose of the last command is the one at which it is seen.
    """
    context = case.context
    here = still(case, checker, context.q_cmd)
    cases = []
    for joint in range(len(context.q_cmd)):
        for way in (OTHER_RAD, -OTHER_RAD):
            q_rad = np.array(context.q_cmd)
            q_rad[joint] += way
            cases.append(
                here.with_context(q_cmd=q_rad, q_meas=q_rad, q_cmd_history=np.tile(q_rad, (2, 1)))
            )
    return alone(checker, cases, "start_pose")


def awkward_posture(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm stands still with a joint at its limit."""
    cases = [still(case, checker, q) for q in postures_of(checker.cell).tight]
    return alone(checker, cases, "joint_position")


def singular_posture(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm stands still where it cannot move in every direction."""
    cases = [still(case, checker, q) for q in postures_of(checker.cell).singular]
    return alone(checker, cases, "singular")


def flipped_branch(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The TCP goes on by so little that the arm must swing over to reach it: a joint is at its end.

    No joint is as fast as that, nor bears it, and the way over leads through whatever is there.
    """
    cases = []
    for q_rad, twist in postures_of(checker.cell).edges:
        here = still(case, checker, q_rad)
        beyond = still(case, checker, q_rad + step_of(checker.cell, q_rad, twist))
        cases.append(here.with_actions(beyond.proposal.actions).as_it_is())
    return alone(checker, cases, "branch_jump", SWINGING)


def folded_posture(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm stands still, folded into itself; also its way there is in collision."""
    cases = [still(case, checker, q).as_it_is() for q in postures_of(checker.cell).folded]
    return alone(checker, cases, "self_collision", OWN_WAY)


def leapt_obstacle(case: Case, checker: FeasibilityChecker, place: Place) -> Case | None:
    """One row leads from one side of the obstacle to the other, too fast for any joint.

    Args:
        case: The case.
        checker: The six layers.
        place: Puts the obstacle half-way between where a case is and where it goes; None
            without one.
    """
    step_m = checker.settings.tcp_speed_limit_m_s * checker.cell.action_period_s
    level = [way for way in directions() if way[2] == 0.0]
    for times in LEAPS:
        leaps = [_going(case, checker, linear_m=times * step_m * way) for way in level]
        placed = [place(leap.as_it_is()) for leap in leaps]
        cases = [leap for leap in placed if leap is not None]
        found = alone(checker, cases, "swept_collision", LEAPING)
        if found is not None:
            return found
    return None


def fast_joint(case: Case, checker: FeasibilityChecker) -> Case | None:
    """A joint goes on faster than it may, as it did before; the TCP does not."""
    cell, limits = checker.cell, checker.cell.usable_limits
    cases = []
    for way in joint_steps(cell, case.context.q_cmd):
        used = np.max(np.abs(way) / (limits.velocity_rad_s * cell.action_period_s))
        cases.append(moving(case, checker, BEYOND * way / used).as_it_is())
    return alone(checker, cases, "joint_velocity")


def fast_tcp(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The TCP goes on faster than it may, as it did before; no joint does."""
    step_m = BEYOND * checker.settings.tcp_speed_limit_m_s * checker.cell.action_period_s
    cases = [_going(case, checker, linear_m=step_m * way).as_it_is() for way in directions()]
    return alone(checker, cases, "tcp_speed")


def fast_turn(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The TCP turns on faster than it may, as it did before; no joint does."""
    step_rad = BEYOND * checker.settings.tcp_turn_limit_rad_s * checker.cell.action_period_s
    cases = [_going(case, checker, turn_rad=step_rad * way).as_it_is() for way in directions()]
    return alone(checker, cases, "tcp_turn")


def aside_in_contact(case: Case, checker: FeasibilityChecker) -> Case | None:
    """What is held goes up or aside while it is in the target."""
    step_m = 1.1 * checker.settings.step_tolerance_m
    cases = [_going(case, checker, linear_m=step_m * way) for way in directions()]
    return alone(checker, cases, "approach_direction")


def fast_in_contact(case: Case, checker: FeasibilityChecker) -> Case | None:
    """What is held goes straight down faster than it may in contact."""
    step_m = BEYOND * checker.settings.contact_speed_limit_m_s * checker.cell.action_period_s
    down = np.array([0.0, 0.0, -step_m])
    return alone(checker, [_going(case, checker, linear_m=down)], "contact_speed")


def pressed_in(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm stands where what is held is pressed into the target, and stays there."""
    cell, context = checker.cell, case.context
    if not holding_in_contact(case, checker) or not cell.collision.shapes.target_body:
        return None
    target = context.scene.target_position_m(cell.collision.shapes)
    reach_m = cell.collision.shapes.held_reach_m
    beyond_m = BEYOND * cell.force_envelope_n[context.phase] / STIFFNESS_N_M
    rotation, level = checker.kinematics.forward(context.q_cmd)[1], np.zeros(3)
    sides = [way for way in directions() if way[2] == 0.0]
    cases = []
    for deep_m in beyond_m * DEEPER:
        for aside in [level, *(far * way for far in ASIDE_M for way in sides)]:
            place = target + aside + np.array([0.0, 0.0, reach_m - deep_m])
            action = join_action(place, rotation, context.last_action[GRIPPER])
            q_rad, reached = checker.ik_chunk(action[None], context.q_cmd)
            # The shortest way out may lead aside: told deeper is not always deeper.
            if reached[0] and _pressed_m(case, checker, q_rad[0]) >= beyond_m:
                cases.append(still(case, checker, q_rad[0]))
    return alone(checker, cases, "contact_force")


def _pressed_m(case: Case, checker: FeasibilityChecker, q_rad: Array) -> float:
    """How deep what is held lies in the target at a pose `q_rad` (J,), m."""
    opening_m = float(case.context.last_action[GRIPPER])
    path = Paths(
        q_rad=np.stack([q_rad, q_rad])[None], opening_m=np.full((1, 2), opening_m),
        held=np.ones((1, 2), dtype=bool), scenes=(case.context.scene,),
        contact_allowed=np.array([True]), clearance_m=np.zeros(1),
    )  # fmt: skip
    return float(pressed_depth_m(checker.cell.collision, path)[0])


def holding_in_contact(case: Case, checker: FeasibilityChecker) -> bool:
    """The task's hand holds something, which may touch its target in the case's phase."""
    closed = case.context.last_action[GRIPPER] <= checker.settings.held_opening_m
    something = checker.collision.shapes.held_reach_m > 0
    return bool(closed and something and case.context.phase in checker.cell.contact_phases)


def _going(
    case: Case,
    checker: FeasibilityChecker,
    *,
    linear_m: Array | None = None,
    turn_rad: Array | None = None,
) -> Case:
    """The TCP goes on by this step as it came."""
    twist = np.concatenate([
        np.zeros(3) if linear_m is None else linear_m,
        np.zeros(3) if turn_rad is None else turn_rad,
    ])  # fmt: skip
    return moving(case, checker, step_of(checker.cell, case.context.q_cmd, twist))
