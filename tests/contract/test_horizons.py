"""The horizons: observation and execution at least one, prediction no shorter than execution."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import parse_settings
from genpolicy.errors import ConfigError

VALUES = {
    "observation_horizon": 2,
    "prediction_horizon": 16,
    "execution_horizon": 8,
    "action_period_s": 0.1,
}


@given(st.integers(-2, 70), st.integers(-2, 520), st.integers(-2, 520))
def test_what_is_accepted_covers_what_is_executed(observed, predicted, executed):
    values = {**VALUES, "observation_horizon": observed, "prediction_horizon": predicted}
    good = 1 <= observed <= 64 and 1 <= executed <= predicted <= 512
    try:
        config = parse_settings(
            HorizonConfig, values | {"execution_horizon": executed}, where="horizons"
        )
    except ConfigError:
        assert not good
    else:
        assert good
        assert config.execution_horizon == executed


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"observation_horizon": 0}, "horizons.observation_horizon is 0, expected at least 1"),
        ({"execution_horizon": 0}, "horizons.execution_horizon is 0, expected at least 1"),
        ({"execution_horizon": 17},
         "horizons.prediction_horizon is 16, expected at least execution_horizon = 17"),
    ],
)  # fmt: skip
def test_a_horizon_that_does_not_fit_is_named(change, text):
    with pytest.raises(ConfigError, match=text):
        HorizonConfig(**{**VALUES, **change})


@pytest.mark.parametrize("period", [0.0, -0.1, 10.1, float("nan"), float("inf"), "0.1"])
def test_a_period_is_a_finite_number_of_seconds(period):
    with pytest.raises(ValidationError):
        HorizonConfig(**{**VALUES, "action_period_s": period})


def test_a_method_without_chunks_sees_the_same_observations():
    single = HorizonConfig(**VALUES).single_action()
    assert (single.prediction_horizon, single.execution_horizon) == (1, 1)
    assert single.observation_horizon == VALUES["observation_horizon"]
    assert single.action_period_s == VALUES["action_period_s"]
    assert single.single_action() == single
