"""Forms in a contract: what is refused, and what is a plain place."""

import pytest

from genpolicy.data.formats.commands import CommandForm, check_commands
from genpolicy.errors import ConfigError

UNITS = {"x": "m", "turn": "unknown"}
OBSERVED = {"hand.x": "m", "hand.roll": "rad"}


def check(pairing, forms):
    check_commands(pairing, forms, units=UNITS, observed=OBSERVED, where="here")


def test_what_is_plain_needs_the_unit_of_what_it_commands():
    check({"x": "hand.x"}, {})
    check(None, {})
    with pytest.raises(ConfigError, match="one unit on both sides"):
        check({"turn": "hand.roll"}, {})
    for form in (CommandForm(form="rate", gain=0.1), CommandForm(gain=2.0), CommandForm(offset=1)):
        assert not form.is_plain
        check({"turn": "hand.roll"}, {"turn": form})


@pytest.mark.parametrize(
    ("pairing", "forms", "text"),
    [
        (None, {"z": CommandForm()}, "forms is 'z', expected one of x, turn"),
        (None, {"x": CommandForm(gain=0.0)}, "gain that moves something"),
        ({}, {}, "one to one"),
        ({"x": "hand.x", "turn": "hand.x"}, {}, "one to one"),
        ({"x": "hand.y"}, {}, "names of the action"),
    ],
)
def test_a_contradiction_is_refused_with_its_place(pairing, forms, text):
    with pytest.raises(ConfigError, match=text) as caught:
        check(pairing, forms)
    assert str(caught.value).startswith("here")


def test_no_other_word_is_a_form():
    with pytest.raises(ValueError, match="form"):
        CommandForm(form="torque")
