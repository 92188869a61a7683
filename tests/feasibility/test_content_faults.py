"""Faults 25-34 of the content of a chunk: each refused with its reason, raw kept."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.action import join_action
from genpolicy.contract.chunk import Projected
from genpolicy.feasibility.admission import Admitted, Rejected


def refused(checker, kit, raw, ctx, reason, **meta):
    result = checker.admit(kit.proposal(raw, **meta), context=ctx)
    assert isinstance(result, Rejected)
    assert result.reason == reason, (result.verdict.margins, result.verdict.detail)
    assert np.array_equal(result.projected.proposal.actions, raw, equal_nan=True)
    return result


@pytest.fixture
def ctx(checker, kit):
    return kit.context(checker, kit.START)


@pytest.fixture
def good(kit):
    return kit.line(kit.START, kit.SIDE)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_25_not_finite(checker, kit, ctx, good, bad):
    good[4, 2] = bad
    refused(checker, kit, good, ctx, "finite")


@pytest.mark.parametrize(
    ("columns", "reason"),
    [
        ([0, 0, 0, 0, 0, 0], "rotation_degenerate"),
        ([1, 0, 0, 1, 0, 0], "rotation_degenerate"),
        ([2, 0, 0, 0, -2, 0], "rotation_not_orthonormal"),
        # A determinant of -1 cannot be written in this representation; mirrored columns are a
        # rotation far from where the tool is.
        ([1, 0, 0, 0, 1, 0], "projection_too_large"),
    ],
)
def test_26_no_rotation(checker, kit, ctx, good, columns, reason):
    good[:, 3:9] = columns
    refused(checker, kit, good, ctx, reason)


@pytest.mark.parametrize("shape", [(16, 7), (16, 11), (0, 10), (17, 10)])
def test_27_wrong_shape(checker, kit, ctx, shape):
    refused(checker, kit, np.ones(shape), ctx, "shape")


def test_27_one_row_without_a_chunk_axis(checker, kit, ctx, good):
    refused(checker, kit, good[0], ctx, "shape")


def test_27_millimetres_and_degrees(checker, kit, ctx, good):
    in_mm, in_degrees = good.copy(), good.copy()
    in_mm[:, :3] *= 1000
    in_degrees[:, 3:9] = np.rad2deg(good[:, 3:9])
    refused(checker, kit, in_mm, ctx, "projection_too_large")
    refused(checker, kit, in_degrees, ctx, "rotation_not_orthonormal")


def test_28_joint_limit_crossed_by_a_microradian(build, kit, ctx, checker, good):
    q, _ = checker.ik_chunk(good, ctx.q_cmd)
    arm = checker.kinematics
    room = float(np.minimum(q - arm.lower_rad, arm.upper_rad - q).min())
    assert isinstance(
        build(joint_margin_rad=room - 1e-6).admit(kit.proposal(good), context=ctx), Admitted
    )
    refused(build(joint_margin_rad=room + 1e-6), kit, good, ctx, "joint_position")


def test_29_unreachable(build, kit, ctx, checker):
    away = kit.line(kit.START, (0.95, 0.0, 0.15))
    verdict = build("workspace").check(Projected(kit.proposal(away), away, 0, 0), context=ctx)
    assert verdict.first_reason == "unreachable"
    refused(checker, kit, away, ctx, "projection_too_large")


def test_30_singular(build, kit, ctx, checker):
    """Stretched out, the condition number passes 30 before the arm's reach ends."""
    arm = checker.kinematics
    xs = np.linspace(0.6, 0.86, 80)
    line = np.stack([xs, 0 * xs, 0.3 + 0 * xs], axis=1)
    solved = arm.solve_with_restarts(
        line, np.tile(kit.DOWN, (80, 1, 1)), q_seed_rad=np.tile(kit.HOME, (80, 1))
    )
    condition = arm.condition_number(solved.q_rad)
    chosen = np.flatnonzero(solved.converged & (condition > 31) & arm.within_limits(solved.q_rad))
    q = solved.q_rad[chosen[0]]
    action = join_action(*arm.forward(q), 0.0)[None]
    there = replace(ctx, q_cmd=q, q_meas=q, last_action=action[0], q_cmd_history=np.tile(q, (2, 1)))
    checker = build("workspace", "joint_position")
    verdict = checker.check(Projected(kit.proposal(action), action, 0, 0), context=there)
    assert verdict.first_reason == "singular"
    assert verdict.layer("kinematic").margin == pytest.approx(30 - condition[chosen[0]], abs=1e-3)


def test_31_collision_only_between_two_actions(build, kit, checker):
    beside, beyond = (0.5, -0.15, 0.15), (0.5, 0.15, 0.15)
    ctx = kit.context(checker, beside)
    jump = kit.line(beside, beyond, n=1)
    verdict = checker.check(Projected(kit.proposal(jump), jump, 0, 0), context=ctx)
    assert verdict.first_reason == "swept_collision"
    assert "post" in verdict.detail


def test_32_jerk_at_the_boundary(build, kit, ctx, good, checker):
    """The chunk itself is smooth; the motion before it was another one."""
    moving = ctx.q_cmd_history.copy()
    moving[0, 3] += 0.008
    shaken = replace(ctx, q_cmd_history=moving)
    strict = build(jerk_factor=0.005, acceleration_factor=1.0)
    good_projected = Projected(kit.proposal(good), good, 0, 0)
    assert strict.check(good_projected, context=ctx).passed
    verdict = strict.check(good_projected, context=shaken)
    assert verdict.first_reason == "joint_jerk"
    assert checker.boundary_jerk_m_s3(good_projected, context=shaken) > (
        checker.boundary_jerk_m_s3(good_projected, context=ctx)
    )


@pytest.mark.parametrize("opening", [-0.02, 0.05, 1.0])
def test_33_gripper_outside_its_range(checker, kit, ctx, good, opening):
    good[9, 9] = opening
    refused(checker, kit, good, ctx, "gripper_range")


def test_34_mean_of_left_and_right(checker, kit, ctx):
    left, right = kit.detour(1), kit.detour(-1)
    for side in (left, right):
        assert isinstance(checker.admit(kit.proposal(side), context=ctx), Admitted)
    result = refused(checker, kit, (left + right) / 2, ctx, "scene_collision")
    assert result.verdict.first_layer == "geometric"
    assert "post" in result.verdict.detail
