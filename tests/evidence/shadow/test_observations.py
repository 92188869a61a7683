"""Held-out moments in equal numbers from every phase."""

from collections import Counter

import numpy as np

from genpolicy.evidence.shadow.observations import held_out_observations, spread
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
