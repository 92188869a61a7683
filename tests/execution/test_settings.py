"""Settings of the executor: in their range, and in whole nanoseconds for those who compare."""

import math
from dataclasses import replace

import pytest

from genpolicy.errors import ConfigError
from genpolicy.evidence.shadow.rig import SETTINGS


@pytest.mark.parametrize("values", [
    {"execution_horizon": 0}, {"action_period_s": 0.0}, {"action_period_s": math.nan},
    {"watchdog_s": 0.01}, {"watchdog_s": math.inf}, {"queue_capacity": 0},
    {"replan_lead_steps": -1}, {"maximum_age_s": {"approach": math.nan}},
    {"maximum_divergence_m": math.nan}, {"fallback_hash": ""},
])  # fmt: skip
def test_settings_are_checked(values):
    with pytest.raises(ConfigError, match="executor setting"):
        replace(SETTINGS, **values)
