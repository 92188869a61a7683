"""Planted in one component alone: found there, named there, and nowhere made up."""

from dataclasses import replace

import pytest

from benchmarks.audit.cases import CAUSES
from benchmarks.audit.recorder import TASKS, record
from benchmarks.audit.runner import judged
from benchmarks.audit.settings import PLANAR
from genpolicy.audit.run import audit

BY_NAME = {cause.name: cause for cause in CAUSES}
SEED = 11


def verdict(name, strength, *, change=lambda data: data):
    """The component followed, and the cause, of a planted data set."""
    plan = BY_NAME[name].plan(SEED, strength, "planar")
    planted = record("planar", plan)
    result = audit(
        change(planted.data), PLANAR, admissible=TASKS["planar"].admissible(plan),
        replay=planted.outcomes.__getitem__, root_seed=SEED,
    )  # fmt: skip
    return result.component.name, judged(result, PLANAR)


@pytest.mark.parametrize(
    ("name", "strength", "component"),
    [
        ("modes of rotation", 90, "rotation"),
        ("modes of gripper time", 0.3, "gripper"),
        ("modes of speed", 2.5, "timing"),
    ],
)
def test_modes_outside_the_route_are_found_where_they_are(name, strength, component):
    followed, cause = verdict(name, strength)
    assert (followed, cause.name) == (component, "valid_modes")


@pytest.mark.parametrize(
    ("name", "strength"), [("a free yaw", 120), ("a free gripper time", 0.3), ("a free speed", 2.5)]
)
def test_a_free_choice_between_two_ends_is_no_two_modes(name, strength):
    _, cause = verdict(name, strength)
    assert cause.name == "unimodal"
    assert "timing" in cause.next_action and "position" in cause.next_action


def test_a_variable_that_turns_the_tool_is_named():
    followed, cause = verdict("hidden operator turns the tool", 1.0)
    assert (followed, cause.text) == ("rotation", "hidden_state(operator)")


def test_one_action_is_not_claimed_of_what_could_not_be_read():
    def broken(data):
        action = data.action.copy()
        action[0, data.action_rotation] = 0.0
        return replace(data, action=action)

    _, cause = verdict("modes of rotation", 90, change=broken)
    assert (cause.text, cause.kind) == ("insufficient_support(rotation)", "component")
    assert "rotation" in cause.next_action
