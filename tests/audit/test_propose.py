"""Settings proposed from units and pairing, and names that do not exist refused."""

import numpy as np
import pytest
from planar import SETTINGS, planar
from planar_dataset import dataset_of

from genpolicy.audit import audit, propose_settings
from genpolicy.errors import ConfigError, ContractError


@pytest.fixture(scope="module")
def valid():
    return planar(episodes=120)


def test_settings_are_proposed_from_units_and_pairing(valid):
    contract = {
        "pairing": {"x": "tcp.x", "y": "tcp.y"}, "labels": {"phase": "phase"},
        "audit": {"minimum_neighbours": 7, "channel_scale": {"goal": 0.02}},
    }  # fmt: skip
    settings = propose_settings(dataset_of(valid[0], manifest={"import_contract": contract}))
    assert settings.position_components == ["tcp.x", "tcp.y"]
    assert settings.action_components == ["x", "y"]
    assert settings.channel_scale["tcp"] == 0.01 and settings.channel_scale["goal"] == 0.02
    assert settings.minimum_separation_m == pytest.approx(0.03)
    assert settings.minimum_neighbours == 7
    assert settings.context_channels == ["goal", "lamp"]  # of one stream with the position
    assert not settings.phase_observed
    assert 8 <= settings.chunk_rows <= 10  # 3 x 3 cm at 1 cm a step


def test_an_unknown_unit_is_scaled_by_the_spread(valid):
    data, _ = valid
    settings = propose_settings(dataset_of(data, unit="unknown"))
    train = data.observation[(data.episodes.split == "train")[data.episode]]
    low, high = np.quantile(train[:, :2], [0.05, 0.95], axis=0)
    assert settings.channel_scale["tcp"] == pytest.approx(0.05 * (high - low).max())
    assert settings.position_components is None and settings.position_channel is None


def test_an_override_that_does_not_exist_is_refused(valid):
    contract = {"audit": {"radios": 3.0}}
    with pytest.raises(ConfigError, match=r"contract.yaml: audit.radios"):
        propose_settings(dataset_of(valid[0], manifest={"import_contract": contract}))
    settings = SETTINGS.model_copy(update={"position_channel": "elbow"})
    with pytest.raises(ContractError, match="naming the channel elbow"):
        audit(dataset_of(valid[0]), settings)


def test_what_the_body_does_is_no_context(valid):
    channels = [
        {"name": "tcp", "components": ["x", "y"], "stream": "robot"},
        {"name": "goal", "components": ["x_m", "y_m"], "stream": "camera"},
        {"name": "wrist", "components": ["phase"], "stream": "robot"},
    ]
    stored = {"channels": [{**c, "unit": "m", "maximum_age_s": 0.5} for c in channels]}
    pairs = {"import_contract": {"pairing": {"x": "tcp.x", "y": "tcp.y"}}}
    dataset = dataset_of(valid[0], manifest={"observation_contract": stored, **pairs})
    assert propose_settings(dataset).context_channels == ["goal"]
    for channel in stored["channels"]:
        channel["stream"] = "all"
    stored["channels"][2]["name"] = "gripper_opening"
    dataset = dataset_of(valid[0], manifest={"observation_contract": stored, **pairs})
    assert propose_settings(dataset).context_channels == ["goal"]
