"""Smoothing of one chunk, and what it changed."""

import numpy as np
import pytest

from genpolicy.contract.action import GRIPPER
from genpolicy.feasibility.kernels.smooth import LEFT_ALONE, changes_of, smooth
from genpolicy.feasibility.projection import SOLVER, _figures
from genpolicy.feasibility.smoothing import PENALTIES, TIGHTENED, ladder


def smoothed(cell, checker, kit, jitter_m):
    ctx, rng = kit.context(checker, kit.START), np.random.default_rng(3)
    raw = kit.line(kit.START, kit.SIDE, opening=0.01)
    raw[:, :3] += rng.normal(0, jitter_m, (kit.K, 3))
    rows, arm, limits = raw.copy(), cell.kinematics, cell.usable_limits
    fixed = np.concatenate([ctx.q_cmd_history, ctx.q_cmd[None]])
    bounds = np.stack([limits.velocity_rad_s, limits.acceleration_rad_s2, limits.jerk_rad_s3])
    rung = smooth(
        arm.turns, arm.offsets, rows, fixed, np.array(ctx.last_action), *ladder(kit.K, 3), bounds,
        _figures(cell), SOLVER, np.array([cell.action_period_s, TIGHTENED]),
    )  # fmt: skip
    return raw, rows, rung


def test_what_needs_no_smoothing_and_what_none_helps_is_left_alone(cell, checker, kit):
    for jitter_m in (0.0, 0.5):
        raw, rows, rung = smoothed(cell, checker, kit, jitter_m)
        assert rung == LEFT_ALONE and np.array_equal(raw, rows)


def test_more_jitter_takes_a_larger_penalty_and_the_gripper_stays(cell, checker, kit):
    rungs = []
    for jitter_m in (0.0007, 0.003):
        raw, rows, rung = smoothed(cell, checker, kit, jitter_m)
        rungs.append(rung)
        assert 0 < np.abs(rows - raw).max() < 0.02
        assert np.array_equal(rows[:, GRIPPER], raw[:, GRIPPER])
    assert 0 <= rungs[0] < rungs[1] < len(PENALTIES)


def test_changes_are_the_largest_of_all_rows(kit):
    raw = kit.line(kit.START, kit.SIDE)
    actions, changes = raw.copy(), np.empty(2)
    actions[4, 0] += 0.003
    actions[7, :3] += [0.0, 0.004, 0.003]
    actions[2, 3:9] = [np.cos(0.1), np.sin(0.1), 0.0, np.sin(0.1), -np.cos(0.1), 0.0]
    changes_of(raw, actions, changes)
    assert changes == pytest.approx([0.005, 0.1], abs=1e-9)


def test_what_says_that_nothing_was_smoothed_is_no_rung():
    """Rungs count from 0; a chunk that the second one smoothed would pass for one left alone."""
    assert LEFT_ALONE < 0
