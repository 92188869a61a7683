"""The kinematic layer: each of its checks alone, and the margins that it gives."""

import numpy as np
import pytest

from genpolicy.feasibility.layers.kinematic import margins


@pytest.fixture(scope="module")
def cases(checker, kit):
    ctx, start = kit.context(checker, kit.START), kit.START
    good = kit.line(start, kit.SIDE)
    return {
        "workspace": kit.Outside(kit.line(start, (0.40, 0.0, 0.285)), ctx),
        "unreachable": kit.Outside(kit.line(start, (0.95, 0.0, 0.15)), ctx, others=None),
        "joint_position": kit.Outside(
            kit.line(start, (0.335, 0, 0.06)), ctx, settings={"joint_margin_rad": 0.2}
        ),
        "singular": kit.Outside(good, ctx, settings={"condition_limit": 5.0}),
    }


@pytest.mark.parametrize("name", ["workspace", "joint_position", "singular"])
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
