"""Verdicts: the first failing check decides, what cannot be evaluated is unknown, six or none."""

import math

import pytest

from genpolicy.feasibility.reasons import Reason, Unit
from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import (
    Gauge,
    LayerOutcome,
    LayerVerdict,
    Verdict,
    judge_layer,
    not_answerable,
    not_reached,
)

NEAR, FAR = Reason.SCENE_COLLISION, Reason.SELF_COLLISION
GAUGES = {NEAR: Gauge(0.1, Unit.M), FAR: Gauge(1.0, Unit.RAD)}


def judged(margins):
    return judge_layer("geometric", margins, GAUGES)


def test_a_layer_passes_with_the_margin_of_its_tightest_check_relative_to_its_limit():
    found = judged({NEAR: 0.09, FAR: 0.1})
    assert found == LayerVerdict("geometric", LayerOutcome.PASSED, None, 0.1, FAR, Unit.RAD)
    assert found.passed is True and found.row is None
    tight = judged({NEAR: 0.0, FAR: 0.1})
    assert (tight.check, tight.unit) == (NEAR, Unit.M)


@pytest.mark.parametrize(
    ("margin", "outcome"),
    [
        (-1e-12, LayerOutcome.FAILED),
        (-math.inf, LayerOutcome.FAILED),
        (math.nan, LayerOutcome.UNKNOWN),
    ],
)
def test_the_first_check_without_a_margin_decides_and_does_not_pass(margin, outcome):
    found = judged({NEAR: margin, FAR: -5.0})
    assert (found.passed, found.outcome) == (False, outcome)
    assert (found.reason, found.check, found.unit) == (NEAR, NEAR, Unit.M)
    assert judged({NEAR: 0.1, FAR: margin}).reason is FAR


def test_a_margin_that_is_missing_is_unknown_and_does_not_pass():
    found = judged({NEAR: 0.1})
    assert (found.outcome, found.reason) == (LayerOutcome.UNKNOWN, FAR) and math.isnan(found.margin)
    assert found.passed is False


def test_a_check_that_asks_for_numbers_fails_where_there_are_none():
    asks = {NEAR: Gauge(1.0, Unit.NONE, LayerOutcome.FAILED)}
    assert judge_layer("geometric", {NEAR: math.nan}, asks).outcome is LayerOutcome.FAILED


def layer_of(name, passed):
    if passed is None:
        return not_reached(name)
    outcome = LayerOutcome.PASSED if passed else LayerOutcome.FAILED
    reason = None if passed else Reason.WORKSPACE
    return LayerVerdict(name, outcome, reason, 0, reason, Unit.M)


def of(*passed):
    layers = tuple(layer_of(name, p) for name, p in zip(LAYERS, passed, strict=False))
    return Verdict(layers, {}, (0, 16))


def test_a_verdict_passes_only_if_all_six_layers_were_reached_and_passed():
    assert of(*[True] * 6).passed
    assert not of(*[True] * 5).passed
    assert not of(*[True] * 5, None).passed
    assert not of(*[True] * 5, False).passed


@pytest.mark.parametrize("outcome", set(LayerOutcome) - {LayerOutcome.PASSED})
def test_no_other_outcome_passes(outcome):
    layers = of(*[True] * 5).layers
    last = LayerVerdict(LAYERS[-1], outcome, None, 1.0, Reason.EXPIRED, Unit.S)
    assert not Verdict((*layers, last), {}, (0, 16)).passed


def test_the_first_rejection_is_named():
    found = of(True, False, None, None, None, None)
    assert (found.first_layer, found.first_reason) == (LAYERS[1], Reason.WORKSPACE)
    assert found.first is found.layers[1] and found.layer(LAYERS[2]).passed is None
    fine = of(*[True] * 6)
    assert fine.first is None and fine.first_reason is None and fine.first_layer == ""


def test_an_unknown_layer_is_a_rejection_by_its_reason():
    first = not_answerable(LAYERS[0], Reason.UNREACHABLE)
    found = Verdict((first, *[not_reached(name) for name in LAYERS[1:]]), {}, (0, 16))
    assert found.first_reason is Reason.UNREACHABLE and first.outcome is LayerOutcome.UNKNOWN
    assert first.check is None and math.isnan(first.margin)
