"""The dynamic layer: each of its checks alone, and its rates against numbers worked by hand."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.action import join_action
from genpolicy.feasibility.batch import Solution
from genpolicy.feasibility.layers.dynamic import margins

RATES = ("joint_velocity", "joint_acceleration", "joint_jerk", "tcp_speed")


def yaw(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


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
    }  # fmt: skip


@pytest.mark.parametrize("name", ["action_period", *RATES, "tcp_turn"])
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
