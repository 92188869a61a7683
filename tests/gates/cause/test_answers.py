"""Each question is answered from one number and one limit."""

import pytest
from planted import BROKEN, named


@pytest.mark.parametrize("layer", BROKEN)
def test_each_layer_names_its_cause_and_says_which_number_is_beyond(layer):
    numbers, name, kind = BROKEN[layer]
    cause = named(numbers)
    assert (cause.name.value, cause.kind, cause.topic.value) == (name, kind, layer)
    assert any(answer.red for answer in cause.answers if answer.topic is cause.topic)
