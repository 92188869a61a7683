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
     (0.5, 0.1, None), (0.4, 0.0, False),
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
    # A column that tells exactly a guess beats none; an interval as wide as half the limit is wide.
    assert named(columns(0.35, told("even", 0.25, 0.25))).name == "valid_modes"
    assert named(columns(0.25, luck, half=0.25), limit(told_share=0.5)).name == "valid_modes"
    assert named(columns(0.375, luck, half=0.25), limit(told_share=0.5)).kind == UNDECIDED


def test_the_best_of_several_is_asked_for_in_its_own_phase():
    luck = told("luck", 0.2, 0.3)
    best = told("recorded_columns", 0.05, 0.1, detail="luck")
    assert named(of(best, luck)).name == "valid_modes"
    assert named(of(best, replace(luck, phase="retreat"))).kind == UNDECIDED
    # What is shown for the best elsewhere says nothing of it here.
    open_ = told("recorded_columns", 0.35, 0.1, detail="scenario")
    guess = replace(told("scenario", -0.2, 0.1), phase="retreat")
    assert named(of(open_, guess)).kind == UNDECIDED
    assert named(of(open_, replace(guess, phase=open_.phase))).name == "valid_modes"


def test_eight_are_shown_and_none_that_is_held_to_the_limit_is_left_out():
    many = [told(f"n{k}", 0.2, 0.3) for k in range(9)]
    held = told("operator", 0.05, 0.1)
    best = told("recorded_columns", 0.05, 0.1, detail="n0")
    cause = named(of(*many, held, best))
    shown = [a for a in cause.answers if a.question == "told_share"]
    assert len(shown) == 8 and [a.limit is not None for a in shown] == [True] * 2 + [False] * 6


def test_a_recorded_column_is_as_concrete_as_who_demonstrated():
    order, column = told("episode_order", 0.75), told("scenario", 0.7)
    assert named(of(order, column)).variable == "scenario"
    assert named(of(told("operator", 0.7), told("scenario", 0.75))).variable == "scenario"
    assert named(of(told("object", 0.7), told("scenario", 0.75))).variable == "object"


def test_nearly_as_much_ends_at_its_limit_and_what_all_shines_through_comes_last():
    close = limit(nearly_equal_effect=0.125)
    order, habit = told("episode_order", 0.875), told("previous_episodes", 0.75)
    assert named(of(order, habit), close).variable == "previous_episodes"
    assert named(of(order, replace(habit, told=0.7499)), close).variable == "episode_order"
    # The mode of another phase is no column: less concrete than the order, more than the past.
    other = told("mode_of_reach", 0.875)
    assert named(of(other, told("recording_sequence", 0.875))).kind == "recording_sequence"
    for last in ("everything_together", "history"):
        assert named(of(told(last, 0.875), other)).variable == "mode_of_reach"


@pytest.mark.parametrize("past", ["history", "recording_sequence"])
def test_what_nobody_recorded_has_the_name_that_the_strata_give_it(past):
    cause = named(of(told(past, 0.875)))
    assert (cause.variable, cause.kind) == ("unrecorded", past)


def test_what_is_not_held_to_the_limit_is_shown_without_one():
    answers = named(columns(0.05, told("n0", 0.1, 0.4), told("sure", 0.1, 0.1))).answers
    shown = {a.what: a.limit for a in answers if a.question == "told_share"}
    limits_of = {what.split()[1]: value for what, value in shown.items()}
    assert limits_of["n0"] is None
    assert limits_of["sure"] == limits_of["recorded"] == 0.4
