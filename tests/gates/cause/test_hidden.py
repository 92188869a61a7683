"""Which hidden variable is named."""

import math
from dataclasses import replace

from planted import HIDDEN, VALID, limit, named

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
