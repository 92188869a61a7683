"""Reasons in words: every one of them, and margins as a person reads them."""

import math

import pytest

from gates.feasibility.settings import REASONS
from gates.pages.reasons import PERSONAL, REASON_WORDS, personal, said
from genpolicy.feasibility.reasons import Reason, Unit


def test_every_reason_is_said_in_words_and_in_the_order_of_the_checks():
    assert tuple(REASON_WORDS) == REASONS == tuple(Reason)
    assert len(set(REASON_WORDS.values())) == len(REASON_WORDS)
    assert all(text and not text.endswith(".") for text in REASON_WORDS.values())


def test_every_unit_has_one_that_a_person_reads():
    mixed = {Unit.M_OR_RAD}
    assert set(PERSONAL) == set(Unit) - mixed
    for factor, name in PERSONAL.values():
        milli = name.startswith(("mm", "ms"))
        assert factor == (1e3 if milli else math.degrees(1.0) if "°" in name else 1.0), name


@pytest.mark.parametrize(("values", "unit", "text"), [
    ([0.0031], "m", "3.1 mm"), ([1.0471975512], "rad", "60°"), ([0.3], "s", "300 ms"),
    ([1.0, 2.0], "rad/s^3", "57.3 to 115°/s³"), ([40.0], "N", "40 N"), ([30.0], "1", "30"),
    ([16], "actions", "16 actions"), ([0.15], "m/s", "150 mm/s"),
    ([12.0, 87.0], "N m", "12 to 87 N m"), ([3750.0], "rad/s^3", "215,000°/s³"),
    ([0.0], "m", "0 mm"),
])  # fmt: skip
def test_a_margin_is_told_in_the_unit_of_a_person(values, unit, text):
    assert personal(values, unit) == text


def test_what_has_no_unit_of_a_person_is_no_number_of_one():
    with pytest.raises(KeyError):
        personal([1.0], "furlong")
    assert said("joint_jerk") == "joint jerk"
