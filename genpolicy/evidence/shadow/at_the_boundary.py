"""Corruptions where commands, or the arm itself, came from: what a chunk at rest cannot go on from.

The arm is told to stay where its last command is, so nothing in the chunk is wrong. Wrong is how
its commands came there, where it was measured, how fast, or when.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import bisect

from genpolicy.contract.action import GRIPPER
from genpolicy.evidence.shadow.at_the_margin import BEYOND, WITHIN
from genpolicy.evidence.shadow.case import Case, alone, still
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.context import Context
from genpolicy.robot.collision import CollisionModel, Paths
from genpolicy.robot.dynamics import ArmDynamics
from genpolicy.seeds import stream

Array = NDArray[np.float64]

UNSTOPPABLE = 4.0  # times the robot's acceleration: no projection can go on from it
HARDEST = 100.0  # times the robot's acceleration: beyond the torque of any joint
WAYS, LOOKS = 400, 7  # places to be cut off at, and where the way back from one is looked at
JOLTS = (4.0, 8.0, 16.0, -4.0, -8.0, -16.0)  # likewise; with gravity, and against it


def broken_boundary(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The commands before came in so fast that nothing can go on from them without a jolt.

    A chunk that is merely rough is no such case: projection smooths it.
    """
    cases = [
        _after(case, checker, joint, (-2 * step, -step))
        for joint, step in enumerate(UNSTOPPABLE * checker.cell.limits.acceleration_rad_s2)
    ]
    return alone(checker, cases, "joint_acceleration")


def jolt_before(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm stands still after a jump of its commands: too much jerk, no acceleration."""
    limit = checker.cell.usable_limits.jerk_rad_s3 * checker.cell.action_period_s
    cases = [_after(case, checker, joint, (-2 * step, 0.0)) for joint, step in enumerate(limit)]
    return alone(checker, cases, "joint_jerk")


def heavy_jolt(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The commands before came in so fast that stopping them takes more torque than a joint has.

    This arm is light: a torque beyond its limit needs an acceleration beyond it.
    """
    limit = checker.cell.limits.acceleration_rad_s2
    cases = [
        _after(case, checker, joint, (-2 * times * step, -times * step))
        for times in JOLTS
        for joint, step in enumerate(limit)
    ]
    behind = ("joint_acceleration", "joint_jerk", "payload_torque")
    return alone(checker, cases, "joint_torque", behind)


def heavy_load(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The commands came in so fast that stopping takes all that a joint has, less what is held."""
    cell, cases = checker.cell, []
    period_s, q_rad = cell.action_period_s, np.array(case.context.q_cmd)
    limits = cell.limits.torque_nm, cell.limits.acceleration_rad_s2

    def over(jolt: float, joint: int, dynamics: ArmDynamics) -> float:
        """Torque beyond the limit that stopping this jolt takes, N m."""
        speed, acceleration = np.zeros((2, 1, len(q_rad)))
        speed[0, joint], acceleration[0, joint] = jolt * period_s / 2, -jolt
        torque = dynamics.torque(q_rad[None], speed, acceleration)
        return float(np.max(np.abs(torque[0]) - limits[0]))

    for joint, size in enumerate(limits[1]):
        for way in (1.0, -1.0):
            most = float(way * size * HARDEST)
            found = [
                bisect(over, most, 0.0, args=(joint, dynamics))
                for dynamics in (cell.dynamics, cell.loaded_dynamics)
                if over(most, joint, dynamics) > 0 > over(0.0, joint, dynamics)
            ]
            if len(found) == 2 and abs(found[1]) < abs(found[0]):
                jolt = sum(found) / 2
                cases.append(_after(case, checker, joint, (-2 * jolt, -jolt)))
    return alone(checker, cases, "payload_torque", ("joint_acceleration", "joint_jerk"))


def left_behind(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm did not follow its commands, and stands where it cannot catch up in time."""
    here = still(case, checker, case.context.q_cmd)
    away = BEYOND * checker.cell.limits.velocity_rad_s * _time_left_s(here, checker)
    cases = []
    for joint, way in enumerate(away):
        q_rad = np.array(case.context.q_cmd)
        q_rad[joint] -= way
        cases.append(here.with_context(q_meas=q_rad))
    return alone(checker, cases, "measured_velocity")


def pushed_aside(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm is where it was told to be, but moves too fast to stop there in time."""
    here = still(case, checker, case.context.q_cmd)
    speeds = BEYOND * checker.cell.limits.acceleration_rad_s2 * _time_left_s(here, checker)
    cases = [here.with_context(dq_meas=row) for row in np.diag(speeds)]
    return alone(checker, cases, "measured_acceleration")


def cut_off(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm was seen on the other side of something: the way back leads through it.

    In time it could come; its commands are where they should be. Where nothing stands between two
    free places, it was seen inside of something.
    """
    cell, context = checker.cell, case.context
    here = still(case, checker, context.q_cmd).with_context(
        state_time_s=context.now_s - WITHIN * context.maximum_age_s
    )
    most_rad = WITHIN * cell.limits.velocity_rad_s * _time_left_s(here, checker)
    ways = stream(0, "corruption", "cut_off").uniform(-1.0, 1.0, (WAYS, len(most_rad)))
    places = context.q_cmd + ways * most_rad
    places = places[cell.kinematics.within_limits(places)]
    there = _depths_m(cell.collision, here.context, places, np.zeros(2))
    between = _depths_m(cell.collision, here.context, places, np.linspace(0.0, 1.0, LOOKS))
    hit = np.flatnonzero(np.maximum(there, between))
    best = hit[np.lexsort((-between[hit], there[hit] > 0))]
    return alone(checker, [here.with_context(q_meas=places[i]) for i in best], "measured_collision")


def _depths_m(model: CollisionModel, context: Context, places: Array, shares: Array) -> Array:
    """How deep something is hit from each of some places (n, J) on, at the shares but the first.

    Returns:
        m. Shape (n,).
    """
    shares = shares[:, None]
    closed = np.full((len(places), len(shares)), context.last_action[GRIPPER])
    report = model.check_samples(Paths(
        q_rad=places[:, None] + shares * (context.q_cmd - places)[:, None],
        opening_m=closed, held=np.zeros(closed.shape, dtype=bool),
        scenes=(context.scene,) * len(places),
        contact_allowed=np.zeros(len(places), dtype=bool), clearance_m=np.zeros(len(places)),
    ))  # fmt: skip
    return np.array([0.0 if hit is None else hit.depth_m for hit in report.hits])


def old_state(case: Case, checker: FeasibilityChecker) -> Case | None:
    """The arm was measured longer ago than anything may be acted on; it stood still then."""
    here = still(case, checker, case.context.q_cmd)
    measured_s = here.context.now_s - here.context.maximum_age_s - checker.cell.action_period_s
    return alone(checker, [here.with_context(state_time_s=measured_s)], "state_age")


def _time_left_s(case: Case, checker: FeasibilityChecker) -> float:
    """From the measurement to the end of the first row's period, s."""
    row = case.context.first_index + 1
    ends_s = case.proposal.metadata.action_start_time_s + row * checker.cell.action_period_s
    return float(ends_s - case.context.measured_at_s)


def _after(
    case: Case, checker: FeasibilityChecker, joint: int, offsets: tuple[float, float]
) -> Case:
    """The arm is told to stay; its commands before were off by so much / T^2 in one joint."""
    history = np.tile(case.context.q_cmd, (2, 1))
    history[:, joint] += np.array(offsets) * checker.cell.action_period_s**2
    here = still(case, checker, case.context.q_cmd)
    return here.with_context(q_cmd_history=history)
