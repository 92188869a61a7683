"""The contracts of a dataset: ranges that follow the unit, rules that are checked."""

import numpy as np
import pytest

from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.data.contract import TCP_ACTION, ActionContract, SplitRule, plausible_ranges
from genpolicy.errors import ConfigError


def test_plausible_ranges_follow_the_unit():
    observation = ObservationContract((Channel("a", ("x_m", "yaw_rad", "n"), "K", "s", 1.0),))
    ranges = plausible_ranges(
        observation, TCP_ACTION, workspace_lower_m=np.zeros(3), workspace_upper_m=np.ones(3)
    )
    assert ranges["a.x_m"] == (-0.1, 1.1)
    assert "a.n" not in ranges
    assert ranges["action.tcp_z_m"] == (-0.1, 1.1)
    assert ranges["action.gripper_opening_m"] == (-1.1, 1.1)
    assert ranges["action.rotation_column_0_x"][1] == pytest.approx(1.0)


def test_contracts_are_checked():
    with pytest.raises(ConfigError, match="units"):
        ActionContract("f", ("a", "b"), ("m",))
    assert ActionContract("f", ("a",), ("m",)).sha256 != ActionContract("f", ("a",), ("px",)).sha256
    with pytest.raises(ConfigError, match="split fractions"):
        SplitRule(0.9, 0.2)
    with pytest.raises(ConfigError, match="split fractions"):
        SplitRule(float("nan"), 0.1)
