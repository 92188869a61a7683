"""Which hidden variable is named."""

import math
from dataclasses import replace

import pytest
from planted import HIDDEN, LIMITS, STRATUM, VALID, limit, named

from gates.cause import (
    CauseName,
)


def test_of_equal_variables_the_most_concrete_is_named_and_the_past_must_show_more():
    past = replace(HIDDEN, variable="history", effect=0.95)
    both = replace(VALID, strata=(past, HIDDEN))
    assert named(both).variable == "operator"
    assert named(both, limit(nearly_equal_effect=0.01, everything_handicap=0.0)).kind == "history"
    lucky = replace(VALID, strata=(replace(HIDDEN, effect_lower=0.05),))
    assert named(lucky).name is CauseName.VALID_MODES
    assert not any(answer.red for answer in named(lucky).answers)
    seen = replace(VALID, strata=(replace(HIDDEN, observed=True),))
    assert (named(seen).name, named(seen).kind) == (CauseName.UNIMODAL, "observed_variable")
    epoch = replace(VALID, strata=(replace(HIDDEN, variable="calibration_epoch"),))
    assert named(epoch).name is CauseName.DATA_DEFECT


def test_a_recorded_column_is_named_before_the_order_and_by_its_strength():
    column = replace(HIDDEN, variable="scenario", effect=0.8)
    order = replace(HIDDEN, variable="episode_order", effect=0.9)
    assert named(replace(VALID, strata=(order, column))).text == "hidden_state(scenario)"
    weaker = replace(HIDDEN, effect=0.75)
    assert named(replace(VALID, strata=(weaker, column))).variable == "scenario"
    assert (
        named(replace(VALID, strata=(replace(column, effect=0.7), weaker))).variable == "operator"
    )
    seen = replace(column, observed=True)
    assert named(replace(VALID, strata=(seen, order))).variable == "episode_order"


def test_a_lower_end_that_is_not_known_spares_nothing():
    """A large share whose interval is not known is held to the limit, never taken for chance."""
    for missing in (None, math.nan):
        damaged = replace(VALID, strata=(replace(HIDDEN, effect_lower=missing),))
        cause = named(damaged)
        assert (cause.name, cause.variable) == (CauseName.HIDDEN_STATE, "operator")
        assert any(answer.red for answer in cause.answers if answer.question == "strata_effect")


UP, DOWN = math.inf, -math.inf


@pytest.mark.parametrize(
    ("column", "question", "away", "away_is_named"),
    [
        ("p_adjusted", "strata_p", UP, False),
        ("effect", "strata_effect", UP, True),
        ("effect_lower", "strata_effect_lower", DOWN, False),
    ],
)
def test_each_test_of_a_variable_ends_at_its_limit(column, question, away, away_is_named):
    """At the level it is significant, at the effect it is small, at the lower end it is sure."""
    at = LIMITS[question]
    for value, is_away in ((at, False), (math.nextafter(at, away), True)):
        cause = named(replace(VALID, strata=(replace(HIDDEN, **{column: value}),)))
        assert (cause.name is CauseName.HIDDEN_STATE) == (is_away == away_is_named)


def _shares(numbers):
    return [a for a in named(numbers).answers if a.question == "strata_effect"]


def test_that_nothing_explains_the_modes_takes_a_variable_that_was_tested():
    (none,) = _shares(replace(VALID, strata=(replace(STRATUM, n=1),)))
    assert (none.measured, none.limit) == (0.0, LIMITS["strata_effect"])
    assert "smallest adjusted p 0.9 (operator)" in none.note
    assert _shares(replace(VALID, strata=(replace(STRATUM, n=0),))) == []
    assert _shares(replace(VALID, strata=(replace(STRATUM, p_adjusted=None),))) == []
    # What luck may explain is shown, and nothing is sure beside it.
    first, lucky = _shares(replace(VALID, strata=(replace(HIDDEN, effect_lower=0.05),)))
    assert first.measured == 0.0 and lucky.limit is None


def test_eight_are_shown_and_a_red_one_is_never_left_out():
    lucky = [
        replace(HIDDEN, variable=f"n{k}", effect=0.9 + 0.01 * k, effect_lower=0.0) for k in range(9)
    ]
    red = replace(HIDDEN, effect=0.5, effect_lower=0.2)
    shown = _shares(replace(VALID, strata=(*lucky, red)))
    assert len(shown) == 8 and shown[0].red and "operator" in shown[0].what
    assert [answer.limit for answer in shown[1:]] == [None] * 7
    assert [answer.measured for answer in shown[1:]] == [0.9 + 0.01 * k for k in range(8, 1, -1)]


def test_a_small_share_that_is_sure_is_held_to_the_limit_with_its_interval():
    small = replace(HIDDEN, effect=0.2, effect_lower=0.15, effect_upper=0.25)
    (answer,) = _shares(replace(VALID, strata=(small,)))
    assert (answer.measured, answer.limit) == (0.2, LIMITS["strata_effect"])
    assert answer.holds and answer.interval == (0.15, 0.25)
    (open_,) = _shares(replace(VALID, strata=(replace(small, effect_upper=None),)))
    assert open_.interval is None


def test_nearly_as_much_ends_at_its_limit_and_the_past_must_show_as_much_more():
    exact = limit(nearly_equal_effect=0.125, everything_handicap=0.25)

    def foremost(*rows):
        strata = (replace(HIDDEN, variable=name, effect=effect) for name, effect in rows)
        return named(replace(VALID, strata=tuple(strata)), exact).kind

    order = "episode_order"
    assert foremost((order, 0.875), ("recording_sequence", 0.75)) == "stratum"
    assert foremost(("recording_sequence", 0.875), (order, 0.75)) == "stratum"
    assert foremost(("recording_sequence", 0.875), (order, 0.7499)) == "recording_sequence"
    # 1.0 less a quarter is as much as 0.75, of which 0.625 is within an eighth.
    assert foremost(("history", 1.0), (order, 0.625)) == "stratum"
    assert foremost(("history", 1.0), (order, 0.6249)) == "history"
    assert foremost(("time_in_episode", 1.0), (order, 0.625)) == "stratum"
    # What was seen is less concrete than what was recorded, and more than what shines through.
    for seen, sequence in ((0.75, 0.75), (0.75, 0.8125), (0.8125, 0.75)):
        rows = ("start_position.0", seen), ("recording_sequence", sequence)
        assert foremost(*rows) == "stratum"
