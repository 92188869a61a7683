"""Numbers in sentences: three digits, percent with what they are of, units that a person uses."""

import math

import pytest

from gates import words


@pytest.mark.parametrize(
    ("part", "whole", "what", "said"),
    [
        (48, 50, "rollouts", "96 % (48 of 50 rollouts)"),
        (0, 1080, "arrivals", "0 % (none of 1,080 arrivals)"),
        (1, 3, "", "33.3 % (1 of 3)"),
        (0, 0, "chunks", "none of 0 chunks"),
        (1234.0, 56789.0, "ticks", "2.17 % (1,234 of 56,789 ticks)"),
    ],
)
def test_a_share_says_what_it_is_of(part, whole, what, said):
    assert words.share_of(part, whole, what) == said


@pytest.mark.parametrize(
    ("gain", "said"),
    [(0.41, "+41 points"), (-0.125, "-12.5 points"), (0.0, "+0 points"), (-0.0, "+0 points")],
)
def test_a_difference_of_shares_is_points(gain, said):
    assert words.points(gain) == said


@pytest.mark.parametrize(
    ("value", "said"), [(0.45, "450 ms"), (1.0, "1 s"), (0.0, "0 s"), (2.3456, "2.35 s")]
)
def test_a_time_below_a_second_is_in_ms(value, said):
    assert words.duration(value) == said


def test_an_interval_says_a_unit_once_that_both_ends_have():
    assert words.span("35.6 %", "50.8 %") == "35.6 to 50.8 %" == words.percents(0.356, 0.508)
    assert words.span("900 ms", "1.2 s") == "900 ms to 1.2 s"
    assert words.share_between(0.481, 0.287, 0.681) == "48.1 % (28.7 to 68.1)"


def test_a_length_below_a_metre_is_in_mm():
    assert (words.length(0.0094), words.length(1.5)) == ("9.4 mm", "1.5 m")


def test_three_digits_and_no_powers_of_ten_where_a_person_writes_none():
    assert words.three(123456.0) == "123,000" and words.three(0.000123456) == "0.000123"
    assert words.three(1e12) == "1e+12"
    assert words.percent(math.nan) == "nan %", "what is not known is no number"
    assert words.number(0.5) == "0.5" and words.number(12345) == "12,345"


@pytest.mark.parametrize(
    ("diagnosis", "advice"),
    [
        ("First unmet: x. Next: record more.", "Next: record more."),
        ("Next: a. Next: b.", "Next: b."),
        ("Nothing to do.", ""),
        ("", ""),
    ],
)
def test_the_last_advice_of_a_diagnosis_is_what_to_do(diagnosis, advice):
    assert words.advice_of(diagnosis) == advice
