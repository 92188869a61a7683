"""P9: inside the limits, idempotent, what is admissible unchanged, raw kept beside it.

Idempotent is projection from a command within the workspace. From one outside the way back is cut
by the speed limit, so that its rows may lie outside as well, and projecting again goes further
back; such a chunk is refused as `workspace`.
"""

from dataclasses import replace

import numpy as np
import pytest
from dense import asked, drawn
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.feasibility.plain import PlainChecker
from genpolicy.contract.action import GRIPPER, POSITION, ROTATION
from genpolicy.contract.chunk import Projected, Proposal
from genpolicy.contract.rotation import angle_between, orthonormality_error, rotation_from_6d
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.cell import cell_of
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.tasks.api import load_task

INSIDE = ((0.37, 0.0, 0.15), (0.40, 0.05, 0.16), (0.45, -0.15, 0.20), (0.31, 0.2, 0.27))
OUTSIDE = ((0.29, 0.0, 0.15), (0.37, 0.0, 0.29), (0.40, 0.225, 0.15), (0.37, 0.0, 0.281))
"""Last commands within the workspace of the kit, and beside it."""


def again(checker, projected, ctx):
    return checker.project(Proposal(projected.metadata, projected.actions, "first"), context=ctx)


def limits_hold(checker, kit, actions, ctx):
    low, high = kit.WORKSPACE.lower_m, kit.WORKSPACE.upper_m
    position, rotation = actions[:, POSITION], rotation_from_6d(actions[:, ROTATION])
    steps = np.diff(np.concatenate([ctx.last_action[None, POSITION], position]), axis=0)
    last = rotation_from_6d(ctx.last_action[ROTATION])[None]
    turns = angle_between(np.concatenate([last, rotation[:-1]]), rotation)
    one = 1 + 1e-8
    return (
        np.all(position >= np.array(low) - 1e-9)
        and np.all(position <= np.array(high) + 1e-9)
        and np.all(
            np.linalg.norm(steps, axis=1) <= checker.settings.tcp_speed_limit_m_s * 0.05 * one
        )
        and np.all(turns <= checker.settings.tcp_turn_limit_rad_s * 0.05 * one + 1e-7)
        and np.all(orthonormality_error(actions[:, ROTATION]) < 1e-9)
        and np.all((actions[:, 9] >= 0) & (actions[:, 9] <= 0.04))
    )


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    noise=st.sampled_from([0.0, 1e-4, 1e-3, 3e-3, 0.02, 0.3]),
    reach=st.floats(0.0, 0.3),
)
def test_from_inside_the_workspace_it_is_within_limits_and_projecting_twice_is_once(
    checker, kit, seed, noise, reach
):
    rng = np.random.default_rng(seed)
    start = INSIDE[seed % len(INSIDE)]
    ctx = kit.context(checker, start)
    end = np.array(start) + reach * rng.normal(0, 1, 3)
    raw = kit.line(start, end) + noise * rng.normal(0, 1, (kit.K, 10)) * ([1] * 9 + [0.3])
    first = checker.project(kit.proposal(raw), context=ctx)
    assert np.array_equal(first.proposal.actions, raw)
    assert limits_hold(checker, kit, first.actions, ctx)
    second = again(checker, first, ctx)
    assert np.abs(second.actions - first.actions).max() <= 1e-9
    moved = np.linalg.norm(first.actions[:, POSITION] - raw[:, POSITION], axis=1).max()
    assert first.position_change_m == pytest.approx(moved, abs=1e-12)


def test_from_outside_what_stays_outside_goes_further_and_is_refused_as_workspace(
    checker, build, kit
):
    low, high = np.array(kit.WORKSPACE.lower_m), np.array(kit.WORKSPACE.upper_m)
    rng, reasons, further_m = np.random.default_rng(1), [], []
    lenient = build(position_change_limit_m=0.2)  # else most are refused for how far they moved
    for start in OUTSIDE:
        ctx = kit.context(checker, start)
        for noise_m in (0.003, 0.02, 0.02, 0.02) * 4:
            raw = kit.line(start, np.array(start) + rng.normal(0, 0.01, 3))
            raw[:, POSITION] += noise_m * rng.normal(0, 1, (kit.K, 3))
            first = checker.project(kit.proposal(raw), context=ctx)
            second = again(checker, first, ctx)
            position = first.actions[:, POSITION]
            stays = bool(np.any((position < low - 1e-9) | (position > high + 1e-9)))
            moved_m = float(np.abs(second.actions - first.actions).max())
            assert stays or moved_m <= 1e-9
            if moved_m > 1e-9:
                assert not checker.check(first, context=ctx).passed
                reasons.append(lenient.check(first, context=ctx).first_reason)
                further_m.append(moved_m)
    assert len(reasons) > 5 and set(reasons) == {"workspace"}
    assert max(further_m) > 1e-3  # no rounding: it is another chunk


def test_what_passes_as_it_is_says_the_same_when_it_is_projected(kit):
    """Dense draws with noise: positions to the bit, the same rotation, the opening in its range."""
    settings_of = FeasibilitySettings(position_change_limit_m=0.05)
    cell = cell_of(load_task("tabletop_insertion"), settings_of, action_period_s=kit.PERIOD_S)
    checker, rng, passed, rewritten = FeasibilityChecker(cell), np.random.default_rng(7), 0, 0
    for _ in range(4):
        families = [drawn(rng, cell) for _ in range(64)]
        found = asked(checker, families, rng.uniform(0, 1, 64) * rng.choice([0.2, 1.0], 64))
        proposals, contexts = [], []
        for proposal, ctx in found.values():
            raw = proposal.actions.copy()
            for columns, sizes in ((POSITION, (0, 1e-5, 1e-4)), (ROTATION, (0, 1e-6, 1e-3))):
                raw[:, columns] += rng.normal(0, rng.choice(sizes), raw[:, columns].shape)
            raw[:, GRIPPER] += rng.normal(0, rng.choice([0, 1e-6, 1e-4]), len(raw))
            proposals.append(Proposal(proposal.metadata, raw, "first"))
            contexts.append(ctx)
        as_they_are = [Projected(p, p.actions, 0.0, 0.0) for p in proposals]
        verdicts = checker.check_many(as_they_are, contexts)
        for verdict, one in zip(verdicts, checker.project_many(proposals, contexts), strict=True):
            if not verdict.passed:
                continue
            raw, actions = one.proposal.actions, one.actions
            assert np.array_equal(actions[:, POSITION], raw[:, POSITION])
            turned = rotation_from_6d(actions[:, ROTATION]) - rotation_from_6d(raw[:, ROTATION])
            assert np.abs(turned).max() <= 1e-12
            assert np.array_equal(actions[:, GRIPPER], np.clip(raw[:, GRIPPER], 0.0, 0.04))
            assert one.position_change_m == 0.0 and one.rotation_change_rad <= 1e-6
            passed += 1
            rewritten += not np.array_equal(actions, raw)
    assert passed > 30 and rewritten > 10  # columns and openings were written anew


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_feasible_chunk_is_left_alone(checker, kit, seed):
    rng = np.random.default_rng(seed)
    ctx = kit.context(checker, kit.START)
    raw = kit.line(kit.START, np.array(kit.START) + rng.uniform(-0.04, 0.04, 3))
    verdict = checker.check(checker.project(kit.proposal(raw), context=ctx), context=ctx)
    projected = checker.project(kit.proposal(raw), context=ctx)
    assert verdict.passed, verdict.first_reason
    assert np.abs(projected.actions - raw).max() <= 1e-9
    assert projected.position_change_m <= 1e-9
    assert projected.rotation_change_rad <= 1e-7


def test_pairs_inside_unchanged_outside_changed_and_then_within(checker, kit):
    ctx = kit.context(checker, kit.START)
    inside = kit.line(kit.START, kit.SIDE)
    fast = inside.copy()
    fast[8:, 0] += 0.04
    outside = kit.line(kit.START, (0.37, 0.0, 0.2805))
    wide = inside.copy()
    wide[:, 9] = 0.042
    skew = inside.copy()
    skew[:, 3:9] *= 1.02
    assert np.abs(checker.project(kit.proposal(inside), context=ctx).actions - inside).max() <= 1e-9
    for raw in (fast, outside, wide, skew):
        projected = checker.project(kit.proposal(raw), context=ctx)
        assert np.abs(projected.actions - raw).max() > 1e-4
        assert limits_hold(checker, kit, projected.actions, ctx)


def test_a_large_change_is_rejected(checker, kit):
    ctx = kit.context(checker, kit.START)
    far = kit.line(kit.START, (0.37, 0.0, 0.33))
    result = checker.admit(kit.proposal(far), context=ctx)
    assert result.reason == "projection_too_large"
    assert np.array_equal(result.projected.proposal.actions, far)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_the_non_finite_is_kept_and_rejected_before_any_geometry(checker, kit, bad, monkeypatch):
    """P12: neither inverse kinematics nor FCL is called."""
    ctx = kit.context(checker, kit.START)

    def never(*args, **kwargs):
        raise AssertionError("reached with a non-finite chunk")

    monkeypatch.setattr(checker.kinematics, "solve", never)
    monkeypatch.setattr(checker.collision, "check_samples", never)
    monkeypatch.setattr(checker.collision, "check_swept", never)
    for column in range(10):
        raw = kit.line(kit.START, kit.SIDE)
        raw[7, column] = bad
        result = checker.admit(kit.proposal(raw), context=ctx)
        assert result.reason == "finite"
        assert np.array_equal(result.projected.actions, raw, equal_nan=True)
        assert result.projected.position_change_m == np.inf


def test_late_rows_do_not_slow_the_chunk(checker, kit):
    ctx = replace(kit.context(checker, kit.START), first_index=3)
    raw = np.concatenate([kit.line(kit.START, kit.SIDE)[-3:], kit.line(kit.START, kit.SIDE)[:13]])
    projected = checker.project(kit.proposal(raw), context=ctx)
    assert np.abs(projected.actions - raw).max() <= 1e-9


def mixed(kit, count=40, seed=0):
    """Chunks with jitter, turns, leaps, late rows and things that are none, in no order."""
    rng = np.random.default_rng(seed)
    found = []
    for i in range(count):
        rows = int(rng.choice([kit.K, kit.K, 5]))
        raw = kit.line(kit.START, np.add(kit.START, rng.normal(0, 0.05, 3)), n=rows)
        raw[:, :3] += rng.normal(0, rng.choice([0.0, 5e-4, 2e-3, 0.02]), (rows, 3))
        raw[:, 3:9] += rng.normal(0, rng.choice([0.0, 1e-3, 0.1]), (rows, 6))
        if i % 11 == 3:
            raw[2, rng.integers(10)] = rng.choice([np.nan, np.inf])
        if i % 11 == 7:
            raw[1, 3:9] = 0.0
        found.append((raw, int(rng.choice([0, 0, 2, kit.K]))))
    return found


def test_projection_is_that_of_the_straightforward_way(cell, checker, kit):
    """Kernels against numpy, chunk by chunk; which chunks are smoothed, too."""
    plain, ctx = PlainChecker(cell), kit.context(checker, kit.START)
    cases = mixed(kit, 120)
    proposals = [kit.proposal(raw) for raw, _ in cases]
    contexts = [replace(ctx, first_index=late) for _, late in cases]
    found, expected = (c.project_many(proposals, contexts) for c in (checker, plain))
    smoothed = 0
    for ours, theirs in zip(found, expected, strict=True):
        assert np.allclose(ours.actions, theirs.actions, atol=1e-12, rtol=0, equal_nan=True)
        assert ours.position_change_m == pytest.approx(theirs.position_change_m, abs=1e-12)
        assert ours.rotation_change_rad == pytest.approx(theirs.rotation_change_rad, abs=1e-12)
        smoothed += 0 < ours.position_change_m < 0.02
    assert smoothed > 20
    assert sum(np.isinf(ours.position_change_m) for ours in found) > 10


def test_a_chunk_has_the_same_bytes_in_any_company(checker, kit):
    """Projection and all margins: alone, with others, and in another order."""
    ctx, other = (kit.context(checker, start) for start in (kit.START, (0.40, 0.05, 0.16)))
    cases = mixed(kit, 33, seed=1)
    proposals = [kit.proposal(raw) for raw, _ in cases]
    contexts = [replace((ctx, other)[i % 2], first_index=late) for i, (_, late) in enumerate(cases)]
    projected = checker.project_many(proposals, contexts)
    verdicts = checker.check_many(projected, contexts, evaluate_all=True)
    backwards = checker.project_many(proposals[::-1], contexts[::-1])[::-1]
    for i in range(len(cases)):
        alone = checker.project(proposals[i], context=contexts[i])
        assert alone.actions.tobytes() == projected[i].actions.tobytes()
        assert alone.actions.tobytes() == backwards[i].actions.tobytes()
        verdict = checker.check(alone, context=contexts[i], evaluate_all=True)
        assert repr(verdict) == repr(verdicts[i])
        if verdict.q_rad is not None:
            assert verdict.q_rad.tobytes() == verdicts[i].q_rad.tobytes()
    assert len({verdict.first_reason for verdict in verdicts}) > 3
