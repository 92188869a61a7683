"""Neighbours: independent training episodes, ties broken at random."""

from dataclasses import replace

import numpy as np
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical


def test_equal_observations_are_broken_at_random_not_by_order():
    # All starts equal: which 20 of 48 training episodes are taken must not follow the identifier.
    from genpolicy.audit.neighbourhoods import find

    data, _ = planar(episodes=80)
    data = canonical(replace(data, observation=data.observation * 0.0))
    taken = []
    for seed in range(40):
        items, _ = find(data, SETTINGS, phase="approach", root_seed=seed)
        taken += data.episode[items[0].rows].tolist()
    counts = np.bincount(taken, minlength=80)[data.episodes.split == "train"]
    assert counts.min() > 0 and counts.max() < 40


def test_neighbours_are_independent_training_episodes(valid):
    data = valid.data
    for item in valid.situations:
        episodes = data.episode[item.neighbourhood.rows]
        assert len(set(episodes.tolist())) == len(episodes)
        assert set(data.episodes.split[episodes]) == {"train"}
        assert set(data.phase[item.neighbourhood.members]) == {item.phase}
        assert data.episodes.split[data.episode[item.neighbourhood.query]] != "train"
