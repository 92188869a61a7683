from dataclasses import replace

import numpy as np
import pytest

from genpolicy.candidates.conformance.recorded_starts import (
    measured,
    recorded_starts,
    require_contract,
)
from genpolicy.contract.observation import ObservationContract
from genpolicy.errors import ContractError


def test_one_moment_of_each_held_out_episode_and_then_four_more_of_each(data, kit):
    starts = recorded_starts(data, kit.HORIZONS, seed=0)
    split = dict(zip(data.episodes["episode_uuid"], data.episodes["split"], strict=True))
    held_out = sorted(uuid for uuid, name in split.items() if name != "train")
    assert {split[uuid] for uuid in held_out} == {"validation", "test"}
    assert sorted(starts.episodes[: starts.apart]) == held_out
    assert len(starts) == 5 * starts.apart
    for part in range(5):
        np.testing.assert_array_equal(
            starts.episodes[part * starts.apart : (part + 1) * starts.apart],
            starts.episodes[: starts.apart],
        )


def test_moments_of_an_episode_lie_a_fifth_of_it_apart(data, kit):
    starts = recorded_starts(data, kit.HORIZONS, seed=0)
    uuids = data.episodes["episode_uuid"].to_numpy()
    lengths = dict(zip(uuids, data.episodes["rows"], strict=True))
    for uuid in set(starts.episodes):
        own = np.flatnonzero(starts.episodes == uuid)
        frames = data.frames.rows(np.flatnonzero(uuids[data.frames.episode] == uuid))
        at = [
            int(np.flatnonzero((frames.observation == starts.observations[row, -1]).all(axis=1))[0])
            for row in own
        ]
        whole = lengths[uuid] - 15
        apart = np.diff(np.sort(at))
        assert np.abs(apart - whole / 5).max() <= 1.0


def test_of_many_episodes_fewer_moments_are_asked(data, kit, monkeypatch):
    monkeypatch.setattr("genpolicy.candidates.conformance.recorded_starts.MOST_MOMENTS", 7)
    starts = recorded_starts(data, kit.HORIZONS, seed=0)
    assert (starts.apart, len(starts)) == (3, 6)
    whole = 5 * 3
    monkeypatch.setattr("genpolicy.candidates.conformance.recorded_starts.MOST_MOMENTS", whole)
    more = recorded_starts(data, kit.HORIZONS, seed=0)
    np.testing.assert_array_equal(more.observations[:3], starts.observations[:3])


def test_a_moment_is_what_was_seen_and_what_was_done_next(data, kit):
    starts = recorded_starts(data, kit.HORIZONS, seed=0)
    uuids = data.episodes["episode_uuid"].to_numpy()
    for row, uuid in enumerate(starts.episodes):
        frames = data.frames.rows(np.flatnonzero(uuids[data.frames.episode] == uuid))
        newest = np.flatnonzero(
            (frames.observation == starts.observations[row, -1]).all(axis=1)
            & (frames.action == starts.chunks[row, 0]).all(axis=1)
        )
        assert any(np.array_equal(frames.action[at : at + 16], starts.chunks[row]) for at in newest)


def test_where_the_robot_was_is_read_from_its_own_channels(data, kit, task):
    starts = recorded_starts(data, kit.HORIZONS, seed=0)
    part = task.observation.slices
    newest = starts.observations[:, -1]
    np.testing.assert_array_equal(starts.measured[:, :3], newest[:, part["tcp_position_m"]])
    np.testing.assert_array_equal(starts.measured[:, 3:9], newest[:, part["tcp_rotation"]])
    np.testing.assert_array_equal(starts.measured[:, 9:], newest[:, part["gripper_opening_m"]])


def test_what_is_not_observed_is_no_number(task):
    wrench = ObservationContract(
        tuple(one for one in task.observation.channels if one.name == "wrench_n")
    )
    assert np.isnan(measured(np.zeros((4, 2, 3)), wrench)).all()


def test_fewer_are_spread_over_all_and_moments_over_the_episodes(data, kit):
    everything = replace(
        data, episodes=data.episodes.assign(split=["train"] + ["test"] * 8 + ["validation"])
    )
    starts = recorded_starts(everything, kit.HORIZONS, seed=0, most=4)
    assert starts.apart == 4
    rows = [
        int(np.flatnonzero((data.frames.observation == seen[-1]).all(axis=1))[0])
        for seen in starts.observations[:4]
    ]
    shares = [data.frames.index[row] for row in rows]
    assert max(shares) - min(shares) > 20


def test_chunks_longer_than_every_episode_are_refused(data, kit):
    longest = int(data.episodes["rows"].max())
    horizons = kit.HORIZONS.model_copy(update={"prediction_horizon": longest + 1})
    with pytest.raises(ContractError, match="at least one as long as a chunk"):
        recorded_starts(data, horizons, seed=0)


def test_the_observation_is_that_of_the_dataset(data, task):
    assert data.observation_contract == task.observation


def test_another_period_or_another_action_is_refused_with_both_sides(data, kit):
    require_contract(data, kit.HORIZONS, candidate="mine")
    slower = kit.HORIZONS.model_copy(update={"action_period_s": 0.1})
    with pytest.raises(ContractError, match=r"0\.1 s, expected 0\.05 s"):
        require_contract(data, slower, candidate="mine")
    action = {**data.manifest["action_contract"], "sha256": "0" * 64, "frame": "joints", "dim": 7}
    other = replace(data, manifest={**data.manifest, "action_contract": action})
    with pytest.raises(ContractError, match="7 numbers in the frame joints"):
        require_contract(other, kit.HORIZONS, candidate="mine")
