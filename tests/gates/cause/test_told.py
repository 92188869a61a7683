"""What tells the mode beyond the limit is hidden state; what may, is not decided; NaN never is."""

import math
from dataclasses import replace

import pytest
from planted import HIDDEN, TOLD, VALID, limit, named

from gates.cause import CauseName, Topic
from gates.cause.told import UNDECIDED, surely


def told(variable, value, half=0.1, **changes):
    return replace(
        TOLD, variable=variable, told=value, told_lower=value - half, told_upper=value + half,
        **changes,
    )  # fmt: skip


def of(*rows):
    return replace(VALID, told=rows)


@pytest.mark.parametrize(
    ("value", "half", "expected"),
    [(0.2, 0.1, False), (0.3, 0.1, False), (0.31, 0.1, None), (0.49, 0.1, None), (0.6, 0.1, True),
     (math.nan, 0.1, None), (0.2, math.nan, None), (0.9, math.nan, None)],
)  # fmt: skip
def test_the_interval_decides_on_which_side_of_the_limit_it_is(value, half, expected):
    assert surely(told("operator", value, half), 0.4) is expected


def test_what_tells_too_much_is_named_and_what_may_is_not_decided():
    sure = named(of(told("operator", 0.6)))
    assert (sure.name, sure.variable, sure.kind) == ("hidden_state", "operator", "prediction")
    assert sure.topic is Topic.HIDDEN
    open_ = named(of(told("operator", 0.45)))
    assert (open_.name, open_.variable, open_.kind) == (
        CauseName.INSUFFICIENT_SUPPORT, "operator", UNDECIDED,
    )  # fmt: skip
    assert named(of(told("operator", 0.45)), limit(told_share=0.6)).name == "valid_modes"
    assert named(of(told("calibration_epoch", 0.6))).name is CauseName.DATA_DEFECT


def test_one_that_is_decided_does_not_hide_one_that_is_not_and_the_sure_one_is_named():
    assert named(of(told("object", 0.0), told("operator", 0.45))).kind == UNDECIDED
    both = named(of(told("object", 0.45), told("episode_order", 0.7)))
    assert (both.name, both.variable) == ("hidden_state", "episode_order")


def test_of_those_that_tell_nearly_as_much_the_most_concrete_is_named():
    everything, habit = told("everything_together", 0.75), told("previous_episodes", 0.7)
    assert named(of(everything, habit)).variable == "previous_episodes"
    assert named(of(everything, habit), limit(nearly_equal_effect=0.01)).variable == (
        "everything_together"
    )


def test_a_significant_stratum_is_still_named_first():
    both = replace(VALID, strata=(HIDDEN,), told=(told("object", 0.9),))
    assert (named(both).variable, named(both).kind) == ("operator", "stratum")


def test_every_answer_says_which_end_was_judged():
    cause = named(of(told("operator", 0.6), told("object", 0.1)))
    first, second = (a for a in cause.answers if a.question == "told_share")
    assert first.red and first.measured == pytest.approx(0.5) and "lower end" in first.note
    assert second.holds and second.measured == pytest.approx(0.2) and "upper end" in second.note


def columns(best, *rows, half=0.1):
    """The best of several recorded columns, and each by itself."""
    named_first = rows[0].variable
    return of(told("recorded_columns", best, half, detail=named_first), *rows)


def test_of_several_columns_only_the_best_is_asked_about():
    noise = [told(f"n{k}", 0.1, 0.4) for k in range(30)]
    # Each by itself may tell more than the limit; together they are one question.
    assert named(of(noise[0])).kind == UNDECIDED
    assert named(columns(0.05, *noise)).name == "valid_modes"
    assert named(columns(0.6, told("scenario", 0.6, 0.3), *noise)).variable == "scenario"
    assert named(columns(0.5, told("scenario", 0.6, 0.15), *noise)).text == "hidden_state(scenario)"


def test_the_best_of_several_must_beat_a_guess_where_there_are_episodes_enough():
    luck, telling = told("luck", 0.2, 0.3), told("scenario", 0.35, 0.3)
    assert named(columns(0.35, luck)).name == "valid_modes"
    found = named(columns(0.35, telling))
    assert (found.kind, found.variable) == (UNDECIDED, "scenario")
    # With few episodes nothing of the kind can be said.
    assert named(columns(0.35, luck, half=0.25)).kind == UNDECIDED
    assert named(columns(0.35, told("nan", math.nan, 0.1))).kind == UNDECIDED


def test_a_recorded_column_is_as_concrete_as_who_demonstrated():
    order, column = told("episode_order", 0.75), told("scenario", 0.7)
    assert named(of(order, column)).variable == "scenario"
    assert named(of(told("operator", 0.7), told("scenario", 0.75))).variable == "scenario"
    assert named(of(told("object", 0.7), told("scenario", 0.75))).variable == "object"


def test_what_is_not_held_to_the_limit_is_shown_without_one():
    answers = named(columns(0.05, told("n0", 0.1, 0.4), told("sure", 0.1, 0.1))).answers
    shown = {a.what: a.limit for a in answers if a.question == "told_share"}
    limits_of = {what.split()[1]: value for what, value in shown.items()}
    assert limits_of["n0"] is None
    assert limits_of["sure"] == limits_of["recorded"] == 0.4
