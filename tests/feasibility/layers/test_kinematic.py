"""The kinematic layer: each of its checks alone, and the margins that it gives."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.chunk import Projected
from genpolicy.feasibility.layers.kinematic import margins


@pytest.fixture(scope="module")
def cases(checker, kit):
    ctx, start = kit.context(checker, kit.START), kit.START
    good = kit.line(start, kit.SIDE)
    return {
        "workspace": kit.Outside(kit.line(start, (0.40, 0.0, 0.285)), ctx),
        "unreachable": kit.Outside(kit.line(start, (0.95, 0.0, 0.15)), ctx, others=None),
        "start_pose": kit.Outside(good, replace(ctx, q_cmd=ctx.q_cmd + 0.0005)),
        "joint_position": kit.Outside(
            kit.line(start, (0.335, 0, 0.06)), ctx, settings={"joint_margin_rad": 0.2}
        ),
        "singular": kit.Outside(good, ctx, settings={"condition_limit": 5.0}),
        "branch_jump": kit.Outside(good, ctx, settings={"branch_limit_rad": 1e-6}),
    }


@pytest.mark.parametrize(
    "name", ["workspace", "start_pose", "joint_position", "singular", "branch_jump"]
)
def test_outside_is_refused_by_exactly_this_check(name, cases, build, kit):
    kit.turns_red(build, name, cases[name])


def test_every_check_has_a_case(cases, kit):
    assert list(cases) == kit.names_of("kinematic")


def test_out_of_reach_is_refused_also_where_the_workspace_would_allow_it(cases, build, kit):
    case, wider = cases["unreachable"], ("workspace", "joint_position")
    verdict = kit.judge(build(*wider), case.actions, case.context)
    assert verdict.first_reason == "unreachable"
    blind = kit.judge(build("unreachable", *wider), case.actions, case.context)
    assert not blind.passed and blind.first_reason != "unreachable"


def test_the_margins_are_distances_to_the_limits(checker, cell, kit):
    """Against the robot's own functions, one row at a time."""
    actions, ctx = kit.line(kit.START, kit.SIDE), kit.context(checker, kit.START)
    batch = kit.solved(kit.batch_of((actions, ctx)), cell)
    found, (q,), arm = margins(batch, cell).values, batch.solved.q_rad, cell.kinematics
    position, _ = arm.forward(q)
    np.testing.assert_allclose(position, actions[:, :3], atol=1e-6)
    low, high = np.array(cell.workspace.lower_m), np.array(cell.workspace.upper_m)
    room = min(np.min(actions[:, :3] - low), np.min(high - actions[:, :3]))
    assert found["workspace"][0] == pytest.approx(room, abs=1e-8)
    room = min(np.min(q - arm.lower_rad), np.min(arm.upper_rad - q))
    assert found["joint_position"][0] == pytest.approx(room - 0.1)
    worst = max(np.linalg.cond(jacobian) for jacobian in arm.jacobian(q))
    assert found["singular"][0] == pytest.approx(30 - worst, rel=1e-6)
    assert 0 <= found["unreachable"][0] <= 1e-6
    assert 0 <= found["start_pose"][0] <= 1e-6


def test_the_last_command_is_one_place_by_its_joints_and_by_its_pose(checker, cell, kit):
    """Off by more than inverse kinematics may miss, in place or turn, or turned by no rotation."""
    actions, ctx = kit.line(kit.START, kit.SIDE), kit.context(checker, kit.START)

    def left(**changes):
        batch = kit.solved(kit.batch_of((actions, replace(ctx, **changes))), cell)
        return margins(batch, cell).values["start_pose"][0]

    def told(columns, number):
        action = np.array(ctx.last_action)
        action[columns] += number
        return action

    assert left(last_action=told(0, 1e-4)) == pytest.approx(1e-6 - 1e-4, abs=1e-6)
    turned = np.array(ctx.last_action)
    turn = np.array([[1, -1e-4, 0], [1e-4, 1, 0], [0, 0, 1]])
    turned[3:9] = (turned[3:9].reshape(2, 3) @ turn.T).ravel()
    assert left(last_action=turned) == pytest.approx(1e-6 - 1e-4, abs=1e-6)
    assert left(last_action=told(slice(3, 9), np.zeros(6))) >= 0
    nothing = np.array(ctx.last_action)
    nothing[3:9] = 0.0
    assert np.isnan(left(last_action=nothing)), "unknown, which does not pass"
    elbow = ctx.q_cmd + 0.001
    assert left(q_cmd=elbow) < -1e-4
    position, rotation = cell.kinematics.forward(elbow[None])
    moved = np.concatenate([position[0], rotation[0].T[:2].ravel(), ctx.last_action[9:]])
    assert left(q_cmd=elbow, last_action=moved) == pytest.approx(1e-6, abs=1e-9)


def turned_over(ctx):
    """The joints of the last command with one of them a whole turn on: the same pose."""
    q_rad = np.array(ctx.q_cmd)
    q_rad[-1] += 2 * np.pi
    return q_rad


def test_a_branch_that_jumps_is_refused_at_its_row_by_what_no_motion_asked_for(build, kit, checker):
    """The seed lies beyond the limits, so that the pose is reached with a joint turned back."""
    ctx = kit.context(checker, kit.START)
    rates = [f"joint_{name}" for name in ("velocity", "acceleration", "jerk", "torque")]
    swept = ("measured_velocity", "measured_acceleration", "swept_collision", "payload_torque")
    others = (*rates, *swept, "measured_collision")
    q_rad = turned_over(ctx)
    there = replace(ctx, q_cmd=q_rad, q_meas=q_rad, q_cmd_history=np.tile(q_rad, (2, 1)))
    still = np.tile(ctx.last_action, (4, 1))
    projected = Projected(kit.proposal(still), still, 0.0, 0.0)
    seeing = build(*others)
    verdict = seeing.check(projected, context=there)
    assert verdict.first_reason == "branch_jump" and verdict.layer("kinematic").unit == "rad"
    turn = np.max(np.abs(verdict.q_rad[0] - q_rad))
    assert turn > 3.0
    assert verdict.layer("kinematic").margin == pytest.approx(0.2 - turn, abs=1e-6)
    located = seeing.located(projected, verdict, context=there)
    assert located.layer("kinematic").row == 0
    assert build("branch_jump", *others).check(projected, context=there).passed


def test_a_step_that_the_tool_asks_for_is_no_jump_however_long(cell, checker, kit):
    """A line in two rows turns joints by a tenth of a radian and more, and keeps its branch."""
    ctx = kit.context(checker, kit.START)
    tight = replace(cell, settings=cell.settings.model_copy(update={"branch_limit_rad": 0.05}))
    actions = kit.line(kit.START, np.add(kit.START, (0.0, 0.1, 0.02)), n=2)
    batch = kit.solved(kit.batch_of((actions, ctx)), tight)
    path = np.concatenate([ctx.q_cmd[None], batch.solved.q_rad[0]])
    longest = np.max(np.abs(np.diff(path, axis=0)))
    assert longest > 0.1
    assert 0.0 < margins(batch, tight).values["branch_jump"][0] <= 0.05
    wide = margins(batch, cell).values["branch_jump"][0]
    assert wide == pytest.approx(0.2 - longest)
