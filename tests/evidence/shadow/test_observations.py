"""Held-out moments in equal numbers from every phase."""

from collections import Counter

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.evidence.shadow.observations import (
    held_out_observations,
    spread,
    two_mode_observations,
)
from genpolicy.seeds import stream


def test_observations_come_from_the_test_split_in_equal_numbers(data, observations, kit):
    split = dict(zip(data.episodes["episode_uuid"], data.episodes["split"], strict=True))
    assert {split[item.episode_uuid] for item in observations} == {"test"}
    assert set(Counter(item.phase for item in observations).values()) == {4}
    for item in observations:
        assert item.history.shape == (2, 24) and item.demonstrated.shape == (16, 10)
        # The command at the observation's own tick is the first of what follows.
        np.testing.assert_array_equal(item.commanded[-1], item.demonstrated[0])
    again = held_out_observations(
        data, horizons=kit.HORIZONS, count=20, generator=stream(1, "shadow")
    )
    assert [(o.episode_uuid, o.index) for o in again] == [
        (o.episode_uuid, o.index) for o in observations
    ]


def test_a_spread_keeps_the_order_and_about_the_count(observations):
    assert spread(observations, 5) == observations[::4]
    assert spread(observations, 100) == observations


def _split(data):
    return dict(zip(data.episodes["episode_uuid"], data.episodes["split"], strict=True))


def test_every_held_out_situation_with_modes_is_an_observation_one_an_episode(data, kit, tmp_path):
    splits = _split(data)
    held = [name for name in kit.uuids(data) if splits[name] != "train"]
    assert {splits[name] for name in held} == {"validation", "test"}
    rows = [(name, index, {"split": splits[name]}) for name in held for index in (4, 0, 9)]
    learned = next(name for name in kit.uuids(data) if splits[name] == "train")
    rows.append((learned, 0, {"split": "train"}))
    audit = kit.write_situations(tmp_path / "audit", rows)
    found = two_mode_observations(data, audit, horizons=kit.HORIZONS)
    assert sorted((o.episode_uuid, o.index) for o in found) == sorted((name, 0) for name in held)
    lengths = data.episodes["rows"].to_numpy()
    for item in found:
        first = int(lengths[: kit.uuids(data).index(item.episode_uuid)].sum())
        np.testing.assert_array_equal(item.history, data.frames.observation[[first, first]])
        np.testing.assert_array_equal(item.demonstrated, data.frames.action[first : first + 16])
        np.testing.assert_array_equal(item.commanded[-1], data.frames.action[first])
        assert item.phase == data.frames.phase[first]


def test_a_situation_that_the_split_does_not_have_is_refused(data, kit, tmp_path):
    name = next(uuid for uuid, split in _split(data).items() if split == "test")
    audit = kit.write_situations(tmp_path / "audit", [(name, 9_999, {})])
    with pytest.raises(ContractError, match=f"situation {name}, row 9999 is not in the split test"):
        two_mode_observations(data, audit, horizons=kit.HORIZONS)
