"""Networks: parts counted, budgets too small refused."""

import pytest

from genpolicy.errors import ConfigError
from genpolicy.policies.methods import METHODS
from genpolicy.policies.networks import (
    Dimensions,
)
from genpolicy.policies.settings import HeadConfig, NetworkConfig


def test_a_budget_too_small_for_a_head_is_refused():
    dimensions = Dimensions(
        observation_horizon=2, observation_dim=24, prediction_horizon=16, action_dim=10
    )
    with pytest.raises(ConfigError, match="head_parameters"):
        METHODS["flow"].build(dimensions, NetworkConfig(head_parameters=1000), HeadConfig())
