"""Splits: causal in time, by episode, by a rule that is hashed."""

import numpy as np

from genpolicy.data.contract import SplitRule
from genpolicy.data.dataset import load_dataset
from genpolicy.data.split import assign_splits, split_hash


def test_splits_are_causal_in_time_and_by_episode(built):
    dataset = load_dataset(built)
    parts = [dataset.split(name) for name in ("train", "validation", "test")]
    assert [len(part.episodes) for part in parts] == [4, 1, 2]
    latest = -np.inf
    seen = set()
    for part in parts:
        assert part.frames.event_time_s.min() > latest
        latest = part.frames.event_time_s.max()
        uuids = set(part.episodes["episode_uuid"])
        assert not uuids & seen
        seen |= uuids
        assert set(part.frames.episode.tolist()) == set(range(len(part.episodes)))
    assert sum(len(part.frames) for part in parts) == len(dataset.frames)


def test_split_rule():
    uuids = [str(n) for n in range(20)]
    times = list(range(20, 0, -1))
    splits = assign_splits(times, uuids, SplitRule(0.7, 0.15))
    assert [splits.count(name) for name in ("train", "validation", "test")] == [14, 3, 3]
    assert splits[0] == "test"
    assert splits[-1] == "train"
    assert assign_splits([1, 1, 1], ["c", "a", "b"], SplitRule()) == ["test", "train", "validation"]
    changed = ["train", *splits[1:]]
    assert split_hash({}, uuids, splits) != split_hash({}, uuids, changed)
