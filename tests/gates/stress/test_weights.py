"""Weights mean what they say: bounded, with an owner and a reason, and none is cut off."""

import copy

import evidence
import pytest
from asked import settings_of

from gates.preregistration import moves, plan_bytes, plan_of
from gates.proof import judge
from gates.stress.weights import LEAST_OF_A_SUCCESS, by_cost, explained, listed, require_weights
from genpolicy.errors import ConfigError

WEIGHTS = {"safety": {"recovery": (0.1, "a")}, "model": {"duration": (0.2, "b")}}
JSON = {owner: {name: list(entry) for name, entry in of.items()} for owner, of in WEIGHTS.items()}


def stated(root, utility):
    evidence.write_params(root, lambda params: params["gate_d"].update(utility=utility))


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        ({"model": {"time": (0.1, "a")}}, "there are duration, fallback, recovery"),
        ({"safety": {"reset": (0.1, "a")}}, "counts 0 already; see reset_upper"),
        ({"safety": {"intervention": (0.1, "a")}}, "see intervention_upper"),
        ({"model": {"compute": (0.1, "a")}}, "no largest number"),
        ({"model": {"distillation": (0.1, "a")}}, "which nobody knows"),
        ({"model": {"duration": (0.0, "a")}}, "above 0"),
        ({"model": {"duration": (-0.1, "a")}}, "above 0"),
        ({"model": {"duration": (0.1, " ")}}, "has no reason"),
        ({"model": {"duration": (0.1, "a")}, "safety": {"duration": (0.1, "a")}}, "one owner"),
        ({"model": {"duration": (0.3, "a"), "fallback": (0.21, "a")}}, "sum to 0.51"),
    ],
)
def test_what_is_no_weight_is_refused_and_says_why(weights, said):
    with pytest.raises(ValueError, match=said):
        require_weights(weights)


def test_a_success_may_lose_up_to_the_floor_and_no_more():
    most = {"model": {"duration": (1.0 - LEAST_OF_A_SUCCESS, "a")}}
    assert require_weights(most) == most
    assert require_weights({}) == {}
    assert by_cost(WEIGHTS) == {"duration": 0.2, "recovery": 0.1}
    assert listed(WEIGHTS) == "duration 0.2, recovery 0.1"
    said = explained(WEIGHTS, 12.0)
    assert "0.1 of the time in recovery (the safety owner: a)" in said and "12 s" in said


def test_a_wrong_weight_is_bad_configuration_at_its_place(ladder):
    stated(ladder, {"safety": {"reset": [0.1, "a person resets the cell"]}})
    with pytest.raises(ConfigError, match=r"gate_d\.utility.*reset_upper"):
        settings_of(ladder, "D")


def test_weights_are_named_on_top_of_the_report_and_nothing_is_said_without(ladder):
    before = judge(ladder, "D")
    assert not any("utility" in text for text in before.caveats)
    assert "mean gain in success" in str(before.criteria)
    stated(ladder, JSON)
    report = judge(ladder, "D")
    assert explained(WEIGHTS, 12.0) in report.caveats
    assert set(report.settings["utility"]) == set(WEIGHTS)


def test_weights_are_part_of_the_plan_only_where_they_are_stated():
    """So that a plan from before stays as it is, byte by byte, and a weight that came shows."""
    plain, weighed, other = (copy.deepcopy(evidence.PARAMS) for _ in range(3))
    plain["gate_d"]["utility"] = {}
    weighed["gate_d"]["utility"] = JSON
    other["gate_d"]["utility"] = {"model": {"duration": [0.4, "b"]}}
    assert plan_bytes(plain) == plan_bytes(evidence.PARAMS)
    assert plan_of(weighed)["gate_d.utility"] == ["", JSON]
    for before, now in ((plain, weighed), (weighed, plain), (weighed, other)):
        found = moves(plan_of(before), now)
        assert [(move.place, move.kind) for move in found] == [("gate_d.utility", "changed")]


def test_an_owner_who_weighs_nothing_is_left_out():
    with pytest.raises(ValueError, match="the model owner weighs no cost"):
        require_weights({"model": {}})
