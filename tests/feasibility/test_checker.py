"""Six layers in order: one verdict each, the same for one chunk or for many."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.chunk import Projected
from genpolicy.execution.checks import without
from genpolicy.feasibility.admission import FeasibilityChecker, Rejected
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.reasons import Reason, Unit
from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import LayerOutcome


def test_inside_passes_every_layer(checker, kit):
    verdict = kit.judge(checker, kit.line(kit.START, kit.SIDE), kit.context(checker, kit.START))
    assert verdict.passed
    assert verdict.first_reason is None
    assert [layer.passed for layer in verdict.layers] == [True] * 6
    assert all(margin >= 0 for margin in verdict.margins.values())
    assert set(verdict.margins) == {check.name for check in CHECKS}


@pytest.mark.parametrize(
    ("setting", "values"),
    [
        ("tcp_speed_limit_m_s", (0.5, 0.25, 0.05)),
        ("joint_margin_rad", (0.1, 0.5, 1.5)),
        ("condition_limit", (30.0, 10.0, 2.0)),
        ("velocity_factor", (0.5, 0.3, 0.05)),
        ("acceleration_factor", (0.5, 0.2, 0.02)),
        ("jerk_factor", (0.5, 0.01, 0.0005)),
        ("clearance_m", (0.001, 0.02, 0.2)),
        ("orthonormality_tolerance", (0.2, 1e-3, 1e-12)),
        ("position_change_limit_m", (0.02, 1e-3, 1e-9)),
        ("held_opening_m", (0.018, 0.01, 0.001)),
    ],
)
def test_lowering_a_limit_never_admits(build, kit, checker, setting, values):
    """P8, on random chunks as projected once: a rejected one stays rejected."""
    rng = np.random.default_rng(11)
    ctx = kit.context(checker, kit.START)
    chunks = []
    for _ in range(12):
        end = np.array(kit.START) + rng.normal(0, 0.06, 3)
        actions = kit.line(kit.START, end) + rng.normal(0, 2e-4, (kit.K, 10))
        chunks.append(checker.project(kit.proposal(actions), context=ctx))
    passed = np.array(
        [
            [v.passed for v in build(**{setting: value}).check_many(chunks, [ctx] * 12)]
            for value in values
        ]
    )
    assert np.all(passed[1:] <= passed[:-1])


def test_one_chunk_or_many_is_the_same(checker, kit):
    ctx = kit.context(checker, kit.START)
    rng = np.random.default_rng(2)
    ends = np.array(kit.START) + rng.normal(0, 0.08, (10, 3))
    proposals = [kit.proposal(kit.line(kit.START, end)) for end in ends]
    projected = checker.project_many(proposals, [ctx] * 10)
    many = checker.check_many(projected, [ctx] * 10)
    for chunk, proposal, verdict in zip(projected, proposals, many, strict=True):
        assert np.allclose(
            checker.project(proposal, context=ctx).actions, chunk.actions, atol=1e-9, rtol=0
        )
        alone = checker.check(chunk, context=ctx)
        assert alone.first_reason == verdict.first_reason
        for name, margin in alone.margins.items():
            if np.isfinite(margin):
                assert verdict.margins[name] == pytest.approx(margin, abs=1e-5, rel=1e-5)


def test_evaluate_all_adds_evidence_and_keeps_the_first_reason(checker, kit):
    ctx = kit.context(checker, kit.START)
    bad = kit.line(kit.START, (0.45, 0, 0.15))
    projected = Projected(kit.proposal(bad, session_epoch=0), bad, 0.0, 0.0)
    short = checker.check(projected, context=ctx)
    full = checker.check(projected, context=ctx, evaluate_all=True)
    assert short.first_reason == full.first_reason == "scene_collision"
    assert short.layer("fresh").passed is None
    assert full.layer("fresh").passed is False
    assert full.layer("dynamic").passed is True
    assert [layer.outcome for layer in short.layers].count(LayerOutcome.NOT_REACHED) == 3


def test_what_a_rejection_leaves_nothing_to_ask_about_is_unknown(checker, kit):
    ctx = kit.context(checker, kit.START)
    far = kit.line(kit.START, kit.START)
    far[5:, :3] = (0.7, 0.2, 0.9)
    none = kit.line(kit.START, kit.SIDE)
    none[3, 0] = np.nan
    loose = FeasibilityChecker(checker.cell, checks=without(CHECKS, "workspace"))
    for bad, reason, first in ((far, "unreachable", "kinematic"), (none, "finite", LAYERS[0])):
        projected = Projected(kit.proposal(bad, session_epoch=0), bad, 0.0, 0.0)
        short = loose.check(projected, context=ctx)
        assert (short.first_layer, short.first_reason) == (first, reason)
        assert short.layer(first).outcome is LayerOutcome.FAILED
        behind = LAYERS[LAYERS.index(first) + 1 :]
        assert {short.layer(name).outcome for name in behind} == {LayerOutcome.NOT_REACHED}
        full = loose.check(projected, context=ctx, evaluate_all=True)
        told = {name: full.layer(name) for name in behind}
        assert told.pop("fresh").outcome is LayerOutcome.FAILED
        assert {layer.outcome for layer in told.values()} == {LayerOutcome.UNKNOWN}
        assert {layer.reason for layer in told.values()} == {Reason(reason)}
        assert not any(layer.passed for layer in told.values())


def test_a_check_that_cannot_be_evaluated_is_unknown_and_refuses(checker, kit):
    """A measurement from behind the first row leaves no time to get there: no velocity at all."""
    ctx = replace(kit.context(checker, kit.START), state_time_s=20.0)
    result = checker.admit_as_it_is(kit.proposal(kit.line(kit.START, kit.SIDE)), context=ctx)
    assert isinstance(result, Rejected) and result.reason is Reason.MEASURED_VELOCITY
    layer = result.verdict.layer("dynamic")
    assert (layer.outcome, layer.unit, layer.passed) == (LayerOutcome.UNKNOWN, Unit.RAD_S, False)
    assert np.isnan(layer.margin) and result.verdict.first_layer == "dynamic"


def test_late_rows_are_not_checked_and_all_behind_them_are(checker, kit):
    ctx = kit.context(checker, kit.START)
    good = kit.line(kit.START, kit.SIDE)
    late = good.copy()
    late[:2, :3] = (0.45, 0.0, 0.15)  # would collide, but those two are past
    on_time = np.concatenate([late[:2], kit.line(kit.START, kit.SIDE)[:14]])
    assert kit.judge(checker, on_time, ctx).first_reason is not None
    assert kit.judge(checker, on_time, replace(ctx, first_index=2)).passed
    tail = good.copy()
    tail[10:, :3] = (0.45, 0.0, 0.15)
    assert not kit.judge(checker, tail, ctx).passed
