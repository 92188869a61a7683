"""Settings of Gate C: none says which checks are asked for."""

import evidence
import pytest

from gates.proof import judge
from genpolicy.errors import ConfigError


def test_no_setting_says_which_checks_are_asked_for(ladder):
    evidence.write_params(ladder, lambda p: p["gate_c"].update(required_checks=["fresh.reset"]))
    with pytest.raises(ConfigError, match="required_checks"):
        judge(ladder, "C")
