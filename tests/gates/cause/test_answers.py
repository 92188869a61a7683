"""Each question is answered from one number and one limit."""

import math
from dataclasses import replace

import pytest
from planted import BROKEN, named

from gates.cause import Answer, Topic


@pytest.mark.parametrize("layer", BROKEN)
def test_each_layer_names_its_cause_and_says_which_number_is_beyond(layer):
    numbers, name, kind = BROKEN[layer]
    cause = named(numbers)
    assert (cause.name.value, cause.kind, cause.topic.value) == (name, kind, layer)
    assert any(answer.red for answer in cause.answers if answer.topic is cause.topic)


@pytest.mark.parametrize(("comparison", "beyond"), [("<=", math.inf), (">=", -math.inf)])
def test_a_number_keeps_its_limit_up_to_the_limit_itself(comparison, beyond):
    answer = Answer("q", Topic.DATA, "what", 0.3, 0.3, comparison)
    assert answer.holds is True and not answer.red
    for measured in (math.nextafter(0.3, beyond), math.nan, beyond):
        assert replace(answer, measured=measured).red
    said = replace(answer, measured=0.2).as_json()
    assert (said["measured"], said["limit"], said["holds"]) == (0.2, 0.3, comparison == "<=")
    for unknown in (replace(answer, measured=None), replace(answer, limit=None)):
        assert unknown.holds is None and not unknown.red
        assert unknown.as_json()["measured"] == unknown.measured
