"""Which hidden variable is named."""

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
