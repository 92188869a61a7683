"""Demonstrations alike in what predicts the action, where nobody stands near."""

from dataclasses import replace

import numpy as np
import pytest
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical
from genpolicy.audit.learned import find_learned, planted_is_found, told_by_mean
from genpolicy.audit.looks import look_at_route
from genpolicy.audit.situations import find_situations
from genpolicy.seeds import stream

DIMS = 20


def widened(modes, seed=1, dims=DIMS):
    """The planar task with as many more observed numbers that have no part in it."""
    data = canonical(planar(episodes=120, modes=modes, seed=seed)[0])
    rng = stream(seed, "irrelevant")
    more = dims - data.observation.shape[1]
    values = rng.normal(0, 0.2, (len(data.episodes), more))[data.episode]
    return replace(
        data,
        observation=np.hstack([data.observation, values + rng.normal(0, 0.002, values.shape)]),
        observation_scale=np.append(data.observation_scale, np.full(more, 0.01)),
        observation_names=(*data.observation_names, *[f"more.{k}" for k in range(more)]),
    )


@pytest.mark.parametrize("modes", ["free", "none"])
def test_in_twenty_numbers_nobody_stands_near_and_modes_are_found_or_denied_all_the_same(modes):
    data = widened(modes)
    assert find_situations(data, SETTINGS, 1)[1][0].analysed == 0
    learned = find_learned(data, SETTINGS, 1)
    (reach,) = learned.support
    assert reach.analysed > 0.8 * reach.queries == 0.8 * (reach.analysed + len(reach.missed))
    kept = look_at_route(data, SETTINGS, learned.found, 1).kept
    assert (len(kept) > 10) if modes == "free" else (len(kept) == 0)


def test_a_goal_that_is_observed_makes_no_modes():
    data = widened("goal")
    learned = find_learned(data, SETTINGS, 1)
    assert not look_at_route(data, SETTINGS, learned.found, 1).kept


def test_modes_of_neighbours_are_asked_again_and_confirmed_or_contradicted():
    for modes, place in (("free", 0), ("none", 1)):
        data = widened(modes, dims=6)
        held = np.flatnonzero((data.index == 2) & (data.episodes.split != "train")[data.episode])[
            :30
        ]
        learned = find_learned(data, SETTINGS, 1, again=dict.fromkeys(held.tolist(), 0.15))
        seen = (learned.confirmed, learned.contradicted)
        assert seen[place] > 20 and seen[1 - place] < 5


def test_planted_modes_drown_in_wide_chunks_and_stand_out_of_tight_ones():
    rng = stream(3, "planted")
    tight, wide = rng.normal(0, 0.002, (24, 6)), rng.normal(0, 0.05, (24, 6))
    found = [
        np.mean([planted_is_found(part, SETTINGS, 0.06, rng) for _ in range(20)])
        for part in (tight, wide)
    ]
    assert found[0] == 1.0 and found[1] < 0.2


def test_clusters_that_the_expected_chunks_order_are_told():
    labels = np.arange(24) % 2
    chunks = (labels - 0.5)[:, None, None] * np.ones((1, 4, 2))
    noise = stream(4, "noise").normal(0, 0.1, chunks.shape)
    assert told_by_mean(chunks, -(0.5 * chunks + noise), labels)
    assert not told_by_mean(chunks, noise, labels)


def test_too_few_episodes_are_all_missed_and_a_seed_decides():
    few = canonical(planar(episodes=20)[0])
    learned = find_learned(few, SETTINGS, 1)
    assert not learned.found and all(item.analysed == 0 for item in learned.support)
    data = widened("none", dims=6)
    first, again, other = (find_learned(data, SETTINGS, seed) for seed in (1, 1, 2))
    queries = [[item.query for _, item, _ in part.found] for part in (first, again, other)]
    assert queries[0] == queries[1] != queries[2]
