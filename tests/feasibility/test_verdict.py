"""Verdicts: the first failing check decides, NaN and missing margins fail, six layers or none."""

import math

import pytest

from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import LayerVerdict, Verdict, judge_layer, not_reached

SCALES = {"near": 0.1, "far": 1.0}


def test_a_layer_passes_with_the_margin_of_its_tightest_check_relative_to_its_limit():
    found = judge_layer("geometric", {"near": 0.09, "far": 0.1}, SCALES)
    assert found == LayerVerdict("geometric", True, "", 0.1, "far")
    assert judge_layer("geometric", {"near": 0.0, "far": 0.1}, SCALES).check == "near"


@pytest.mark.parametrize("margin", [-1e-12, math.nan, -math.inf])
def test_the_first_check_without_a_margin_fails_the_layer(margin):
    found = judge_layer("geometric", {"near": margin, "far": -5.0}, SCALES)
    assert (found.passed, found.reason) == (False, "near")
    assert judge_layer("geometric", {"near": 0.1, "far": margin}, SCALES).reason == "far"


def test_a_margin_that_is_missing_fails():
    found = judge_layer("geometric", {"near": 0.1}, SCALES)
    assert (found.passed, found.reason) == (False, "far") and math.isnan(found.margin)


def of(*passed):
    pairs = zip(LAYERS, passed, strict=False)
    layers = tuple(
        not_reached(name) if p is None else LayerVerdict(name, p, "" if p else f"bad {name}", 0, "")
        for name, p in pairs
    )
    return Verdict(layers, {}, (0, 16))


def test_a_verdict_passes_only_if_all_six_layers_were_reached_and_passed():
    assert of(*[True] * 6).passed
    assert not of(*[True] * 5).passed
    assert not of(*[True] * 5, None).passed
    assert not of(*[True] * 5, False).passed


def test_the_first_rejection_is_named():
    found = of(True, False, None, None, None, None)
    assert (found.first_layer, found.first_reason) == (LAYERS[1], f"bad {LAYERS[1]}")
    assert found.layer(LAYERS[2]).passed is None
    assert of(*[True] * 6).first_layer == of(*[True] * 6).first_reason == ""
