"""Smoothing into the joint limits."""

import numpy as np

from benchmarks.feasibility.plain import rate_excess, smoothed
from genpolicy.robot.limits import PANDA


def test_jitter_is_smoothed_into_the_joint_limits(checker, kit):
    """A millimetre of jitter breaks the acceleration limit; little smoothing brings it back."""
    ctx = kit.context(checker, kit.START)
    rng = np.random.default_rng(5)
    raw = kit.line(kit.START, kit.SIDE)
    raw[:, :3] += rng.normal(0, 1e-3, (kit.K, 3))
    projected = checker.project(kit.proposal(raw), context=ctx)
    assert 0 < projected.position_change_m < 0.006
    assert checker.check(projected, context=ctx).passed
    q, reached = checker.ik_chunk(raw, ctx.q_cmd)
    assert reached.all()
    whole = np.concatenate([ctx.q_cmd_history, ctx.q_cmd[None], q])
    assert rate_excess(whole, fixed_points=3, limits=PANDA.scaled(0.5), period_s=0.05) > 1


def test_smoothing_keeps_the_fixed_beginning_and_the_order_of_the_ladder():
    rng = np.random.default_rng(0)
    fixed = np.zeros((3, 7))
    path = np.cumsum(rng.normal(0, 0.01, (16, 7)), axis=0)
    results = list(smoothed(path, fixed, limits=PANDA.scaled(0.5), period_s=0.05))
    assert results
    change = [np.abs(r - path).max() for r in results]
    assert change == sorted(change)
    assert not list(smoothed(path * 1e-3, fixed, limits=PANDA.scaled(0.5), period_s=0.05))
