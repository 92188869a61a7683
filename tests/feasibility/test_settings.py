"""Settings of feasibility are strict."""

import pytest

from genpolicy.feasibility.settings import FeasibilitySettings


def test_settings_are_strict():
    with pytest.raises(ValueError, match="extra"):
        FeasibilitySettings(speed=1.0)
    with pytest.raises(ValueError, match="finite"):
        FeasibilitySettings(clearance_m=float("nan"))
