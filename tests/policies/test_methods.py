"""The registered methods: one budget for all heads, their horizons, their names."""

import pytest
import torch

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import parse_settings
from genpolicy.errors import ConfigError
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.methods import METHODS, method_named
from genpolicy.policies.networks import (
    Dimensions,
    flops_per_evaluation,
    parameter_counts,
)
from genpolicy.policies.settings import HeadConfig, NetworkConfig


def test_heads_fill_one_budget():
    network, head = NetworkConfig(), HeadConfig()
    totals, encoders, trunks = [], set(), set()
    for method in METHODS.values():
        horizon = 16 if method.chunked else 1
        dimensions = Dimensions(
            observation_horizon=2, observation_dim=24, prediction_horizon=horizon, action_dim=10
        )
        counts = parameter_counts(method.build(dimensions, network, head))
        assert abs(counts["head"] - network.head_parameters) <= 0.05 * network.head_parameters
        assert flops_per_evaluation(method.build(dimensions, network, head))["total"] < 2.2e6
        totals.append(counts["total"])
        encoders.add(counts["encoder"])
        trunks.add(counts["trunk"])
    assert len(encoders) == len(trunks) == 1
    assert max(totals) - min(totals) <= 0.01 * max(totals)
    assert 0.9e6 < totals[0] < 1.2e6


def test_horizons():
    good = {"observation_horizon": 2, "prediction_horizon": 16, "execution_horizon": 8}
    horizons = HorizonConfig(**good, action_period_s=0.05)
    assert method_named("bc").horizons(horizons).prediction_horizon == 1
    assert method_named("flow").horizons(horizons) is horizons
    for change, field in (
        ({"execution_horizon": 17}, "prediction_horizon"),
        ({"observation_horizon": 0}, "observation_horizon"),
        ({"execution_horizon": 0}, "execution_horizon"),
        ({"action_period_s": "0.05"}, "action_period_s"),
        ({"action_period_s": float("nan")}, "action_period_s"),
        ({"surprise": 1}, "surprise"),
    ):
        with pytest.raises(ConfigError, match=field):
            parse_settings(
                HorizonConfig, {**good, "action_period_s": 0.05, **change}, where="horizons"
            )


def test_cvae_is_act_drawn_from_its_prior(folders):
    act, cvae = (load_checkpoint(folders[name]) for name in ("act", "cvae"))
    assert act.config.method != cvae.config.method
    weights = cvae.network.state_dict()
    assert all(torch.equal(weights[k], v) for k, v in act.network.state_dict().items())
