"""The dynamic layer: each of its checks alone, and its rates against numbers worked by hand."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.action import join_action
from genpolicy.contract.chunk import Projected
from genpolicy.feasibility.batch import Batch, Solution
from genpolicy.feasibility.inverse import solved
from genpolicy.feasibility.layers.dynamic import margins
from genpolicy.robot.dynamics import ArmDynamics

RATES = ("joint_velocity", "joint_acceleration", "joint_jerk", "tcp_speed")
STATE = (
    "joint_torque", "payload_torque", "measured_velocity", "measured_acceleration", "state_age",
    "controller_mode",
)  # fmt: skip


def yaw(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def jolted(ctx, acceleration, *, joint):
    """The commands before came in at a speed that stopping takes this acceleration for."""
    history = np.tile(ctx.q_cmd, (2, 1))
    history[:, joint] += np.array([2.0, 1.0]) * acceleration * 0.05**2
    return replace(ctx, q_cmd_history=history)


def only_when_loaded(cell, ctx):
    """An acceleration of joint 1 that the empty arm just bears and the loaded one does not."""
    sizes = np.arange(50.0, 400.0, 0.02)
    q, acceleration = np.tile(ctx.q_cmd, (len(sizes), 1)), np.zeros((len(sizes), 7))
    acceleration[:, 1] = sizes
    speed = -acceleration * 0.05 / 2
    empty, loaded = (
        np.min(cell.limits.torque_nm - np.abs(d.torque(q, speed, acceleration)), axis=1)
        for d in (cell.dynamics, cell.loaded_dynamics)
    )
    found = sizes[(empty >= 0) & (loaded < 0)]
    return float(found[len(found) // 2])


@pytest.fixture(scope="module")
def cases(checker, kit):
    start, ctx = np.array(kit.START), kit.context(checker, kit.START)
    good, flat = kit.line(start, kit.SIDE), np.tile(kit.DOWN, (kit.K, 1, 1))
    spiky, turned = good.copy(), kit.line(start, start)
    spiky[8, 1] += 0.012
    for i in range(kit.K):
        turned[i] = join_action(start, kit.DOWN @ yaw(0.07 * (i + 1)), 0.0)
    far, high = (0.40, 0.17, 0.15), (0.37, 0.0, 0.27)
    return {
        "action_period": kit.Outside(good, ctx, {"action_period_s": 0.1}),
        "joint_velocity": kit.Outside(
            join_action(np.linspace(start, far, 9)[1:], flat[:8], 0.0), ctx,
            settings={"tcp_speed_limit_m_s": 2.0, "velocity_factor": 0.3}, others=RATES,
        ),
        "joint_acceleration": kit.Outside(spiky, ctx, others=RATES),
        "joint_jerk": kit.Outside(good, ctx, settings={"jerk_factor": 0.003}),
        "tcp_speed": kit.Outside(
            join_action(np.linspace(start, high, 5)[1:], flat[:4], 0.0), ctx, others=RATES
        ),
        "tcp_turn": kit.Outside(turned, ctx, others=("joint_acceleration", "joint_velocity")),
        "joint_torque": kit.Outside(
            np.tile(ctx.last_action, (kit.K, 1)), jolted(ctx, 300.0, joint=1),
            others=("joint_acceleration", "joint_jerk", "payload_torque"),
        ),
        "payload_torque": kit.Outside(
            np.tile(ctx.last_action, (kit.K, 1)),
            jolted(ctx, only_when_loaded(checker.cell, ctx), joint=1),
            others=("joint_acceleration", "joint_jerk"),
        ),
        "measured_velocity": kit.Outside(good, replace(ctx, q_meas=ctx.q_cmd - 0.12)),
        "measured_acceleration": kit.Outside(good, replace(ctx, dq_meas=np.full(7, 0.5))),
        "state_age": kit.Outside(good, replace(ctx, state_time_s=ctx.now_s - 0.31)),
        "controller_mode": kit.Outside(good, replace(ctx, controller_mode="joint_position")),
    }  # fmt: skip


@pytest.mark.parametrize("name", ["action_period", *RATES, "tcp_turn", *STATE])
def test_outside_is_refused_by_exactly_this_check(name, cases, build, kit):
    assert list(cases) == kit.names_of("dynamic")
    kit.turns_red(build, name, cases[name])


def test_rates_by_hand(checker, cell, kit):
    """q = t^3 in joint 0: differences of a cubic have a constant third one, 6 T^3."""
    period_s, ctx = cell.action_period_s, kit.context(checker, kit.START)
    t = period_s * np.arange(-2, 5)
    q = np.zeros((7, 7))
    q[:, 0] = t**3
    there = replace(ctx, q_cmd=q[2], q_cmd_history=q[:2])
    still = np.tile(ctx.last_action, (4, 1))
    batch = replace(
        kit.batch_of((still, there)),
        solution=Solution(q[None, 3:], np.zeros((1, 4)), np.zeros((1, 4))),
    )
    found = margins(batch, cell).values
    fastest = (t[-1] ** 3 - t[-2] ** 3) / period_s
    tight = replace(cell, limits=replace(cell.limits, jerk_rad_s3=np.full(7, 10.0)))
    assert margins(batch, tight).values["joint_jerk"][0] == pytest.approx(5 - 6, abs=1e-4)
    tight = replace(cell, limits=replace(cell.limits, velocity_rad_s=np.full(7, 0.02)))
    assert margins(batch, tight).values["joint_velocity"][0] == pytest.approx(
        0.01 - fastest, abs=1e-7
    )
    assert found["tcp_speed"][0] == pytest.approx(0.5, abs=1e-6)
    assert found["tcp_turn"][0] == pytest.approx(1.25, abs=1e-5)


def test_without_a_history_higher_rates_are_not_assumed(checker, cell, kit):
    """One row and no command before the last: one difference, and no second or third."""
    ctx = replace(kit.context(checker, kit.START), q_cmd_history=np.zeros((0, 7)))
    one = kit.line(kit.START, (0.372, 0.0, 0.15), n=1)
    found = margins(kit.solved(kit.batch_of((one, ctx)), cell), cell).values
    assert np.isfinite(found["joint_velocity"][0])
    assert found["joint_acceleration"][0] == found["joint_jerk"][0] == np.inf


def test_a_missing_history_is_not_invented(checker, kit):
    """Without earlier commands the boundary's acceleration is not judged; with them it is."""
    good, ctx = kit.line(kit.START, kit.SIDE), kit.context(checker, kit.START)
    moved = ctx.q_cmd_history.copy()
    moved[-1, 0] -= 0.05
    assert kit.judge(checker, good, replace(ctx, q_cmd_history=np.zeros((0, 7)))).passed
    rejected = kit.judge(checker, good, replace(ctx, q_cmd_history=moved))
    assert rejected.first_reason == "joint_acceleration"


def of_one_row(kit, cell, ctx, **meta):
    """Margins where the arm is told to stay where its last command is."""
    chunk = Projected(kit.proposal(ctx.last_action[None], **meta), ctx.last_action[None], 0.0, 0.0)
    return margins(kit.solved(Batch((chunk,), (ctx,)), cell), cell).values


def test_the_step_from_the_measured_state_by_hand(checker, cell, kit):
    """One joint is 0.05 rad behind: in one period 1 rad/s, in two half of it."""
    ctx = kit.context(checker, kit.START)
    q_meas = np.array(ctx.q_cmd)
    q_meas[0] -= 0.05
    behind = replace(ctx, q_meas=q_meas, dq_meas=np.array([-0.3, 0, 0, 0, 0, 0, 0]))
    limits = cell.limits
    for rows_away, time_s in ((0, 0.05), (1, 0.10)):
        found = of_one_row(kit, cell, behind, action_start_time_s=10.0 + 0.05 * rows_away)
        assert found["measured_velocity"][0] == pytest.approx(
            limits.velocity_rad_s[0] - 0.05 / time_s, abs=1e-6
        )
        expected = min(limits.acceleration_rad_s2[0] - 0.3 / time_s, 7.5)
        assert found["measured_acceleration"][0] == pytest.approx(expected, abs=1e-4)


def test_an_arm_that_follows_at_the_speed_of_its_commands_need_not_catch_up(checker, cell, kit):
    """However far behind, within its speed: its velocity is that of the next step already."""
    ctx = kit.context(checker, kit.START)
    far = replace(ctx, q_meas=ctx.q_cmd - 0.05, dq_meas=np.zeros(7))
    found = of_one_row(kit, cell, far)
    assert found["measured_acceleration"][0] == pytest.approx(7.5, abs=1e-4)


def test_an_arm_measured_once_has_no_known_velocity(checker, cell, kit):
    ctx = kit.context(checker, kit.START)
    assert of_one_row(kit, cell, ctx)["measured_acceleration"][0] == np.inf


@pytest.mark.parametrize("start_s", [9.95, 9.9])
def test_a_row_that_ended_before_the_measurement_is_refused(start_s, checker, cell, kit):
    """Nothing is left of the time to get there."""
    ctx = kit.context(checker, kit.START)
    found = of_one_row(kit, cell, ctx, action_start_time_s=start_s)
    assert not found["measured_velocity"][0] >= 0


@pytest.mark.parametrize(
    ("age_s", "feasible"), [(0.0, True), (0.3, True), (0.31, False), (-0.01, False)]
)
def test_a_state_is_neither_old_nor_of_the_future(age_s, feasible, checker, cell, kit):
    ctx = replace(kit.context(checker, kit.START), state_time_s=10.0 - age_s)
    assert (of_one_row(kit, cell, ctx, action_start_time_s=10.2)["state_age"][0] >= 0) == feasible


def test_torque_is_that_of_the_path_with_what_it_knows(checker, cell, kit):
    """Standing still the arm bears its weight; without a command before, nothing is known."""
    ctx = kit.context(checker, kit.START)
    still = ArmDynamics(cell.kinematics).torque(ctx.q_cmd[None], np.zeros((1, 7)), np.zeros((1, 7)))
    left = np.min(cell.limits.torque_nm - np.abs(still))
    assert of_one_row(kit, cell, ctx)["joint_torque"][0] == pytest.approx(left, abs=1e-2)
    alone = replace(ctx, q_cmd_history=np.zeros((0, 7)))
    assert of_one_row(kit, cell, alone)["joint_torque"][0] == np.inf


def test_a_controller_whose_mode_is_not_known_is_in_no_mode(checker, cell, kit):
    ctx = kit.context(checker, kit.START)
    here = np.tile(ctx.last_action, (kit.K, 1))
    for mode, passes in ((cell.controller_mode, True), ("", False), ("joint_position", False)):
        found = margins(solved_batch(kit, checker, here, replace(ctx, controller_mode=mode)), cell)
        assert (found.values["controller_mode"][0] >= 0) == passes
    nameless = replace(cell, controller_mode="")
    found = margins(solved_batch(kit, checker, here, replace(ctx, controller_mode="")), nameless)
    assert found.values["controller_mode"][0] < 0


def solved_batch(kit, checker, actions, ctx):
    return solved(kit.batch_of((actions, ctx)), checker.cell)


def test_only_a_closed_hand_carries_its_payload(checker, cell, kit):
    """The gripper opens in the second row: the torque at the first row is asked with the load."""
    ctx = kit.context(checker, kit.START)
    here = np.tile(ctx.last_action, (4, 1))
    closed, opening, opened = here.copy(), here.copy(), here.copy()
    opening[1:, -1] = opened[:, -1] = 0.04
    wide = replace(ctx, last_action=opened[0])
    found = [
        margins(solved_batch(kit, checker, actions, state), cell).values["payload_torque"][0]
        for actions, state in ((closed, ctx), (opening, ctx), (opened, wide))
    ]
    empty = margins(solved_batch(kit, checker, here, ctx), cell).values["joint_torque"][0]
    assert found[0] == pytest.approx(found[1]) and found[2] == np.inf
    assert 0 < empty - found[0] < 5.0  # what 50 g weigh at the arm's length, and no more


def test_a_scene_that_welds_nothing_has_no_payload(checker, cell, kit):
    ctx = kit.context(checker, kit.START)
    batch = solved_batch(kit, checker, np.tile(ctx.last_action, (4, 1)), ctx)
    bare = replace(cell)
    bare.__dict__["payload"] = None
    assert margins(batch, bare).values["payload_torque"][0] == np.inf
