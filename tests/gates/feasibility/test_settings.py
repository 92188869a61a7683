"""Settings of Gate C: none says which checks are asked for."""

import evidence
import pytest
from asked import settings_of

from gates.feasibility.settings import FeasibilitySettings
from gates.proof import judge
from genpolicy.errors import ConfigError


def test_no_setting_says_which_checks_are_asked_for(ladder):
    evidence.write_params(ladder, lambda p: p["gate_c"].update(required_checks=["fresh.reset"]))
    with pytest.raises(ConfigError, match="required_checks"):
        judge(ladder, "C")


def test_one_observation_of_a_mode_compares_nothing(ladder):
    """The floor for a ladder that leads to a card is higher, and stands in `gates.protection`."""
    known = settings_of(ladder, "C").model_dump()
    few = FeasibilitySettings.model_validate(known | {"mode_observations": 2})
    assert few.mode_observations == 2
    with pytest.raises(ValueError, match="mode_observations"):
        FeasibilitySettings.model_validate(known | {"mode_observations": 1})
