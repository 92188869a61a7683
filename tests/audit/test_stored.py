"""The place in the files tells of a pattern, and of nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from planar import planar

from genpolicy.audit.data import canonical
from genpolicy.audit.stored import LEVEL, places, sequence_test
from genpolicy.audit.strata import _nearby_mode
from genpolicy.seeds import stream

EPISODES = 120


def drawn(seed, modes, order=None):
    """Data with places, the modes stored nearby, and rows of one situation each of ten."""
    data = canonical(planar(episodes=EPISODES, seed=1)[0])
    stored = np.arange(EPISODES, dtype=float) if order is None else np.asarray(order, dtype=float)
    data = replace(
        data, stored=stored, episodes=replace(data.episodes, outcome=np.full(EPISODES, "success"))
    )
    rows = np.flatnonzero(data.index == 0)
    blocks = stream(seed, "situations").integers(0, 5, EPISODES)
    return data, _nearby_mode(stored, modes), (rows, modes, blocks)


def in_turns(seed, length=8):
    return (np.arange(EPISODES) // length + seed) % 2


def test_places_count_numbers_as_numbers_and_names_must_differ():
    labels = [f"b.hdf5#demo_{k}" for k in (10, 9, 2)] + ["a.hdf5#demo_3"]
    assert places(labels).tolist() == [3.0, 2.0, 1.0, 0.0]
    assert places(["same", "same", "other"]) is None and places(["alone"]) is None


@pytest.mark.parametrize("backwards", [False, True])
def test_turns_are_a_pattern_in_either_direction(backwards):
    modes = in_turns(0)
    order = np.arange(EPISODES)[::-1] if backwards else None
    data, nearby, rows = drawn(1, modes, order)
    test = sequence_test(data, nearby, rows, seeds=(1, "any"))
    assert test is not None and test.effect > 0.3
    assert sequence_test(replace(data, stored=None), nearby, rows, seeds=(1, "any")) is None


def test_episodes_dealt_to_their_places_have_none():
    found = 0
    for seed in range(40):
        modes = stream(seed, "dealt").permutation(in_turns(seed))
        data, nearby, rows = drawn(seed, modes)
        found += sequence_test(data, nearby, rows, seeds=(seed, "any")) is not None
    assert found <= 1 and LEVEL < 0.01


def test_what_is_sorted_by_length_or_outcome_is_no_sequence():
    modes = (np.arange(EPISODES) >= EPISODES // 2).astype(int)
    data, nearby, rows = drawn(2, modes)
    assert sequence_test(data, nearby, rows, seeds=(1, "any")) is not None
    outcome = np.where(modes == 1, "failure", "success")
    apart = replace(data, episodes=replace(data.episodes, outcome=outcome))
    assert sequence_test(apart, nearby, rows, seeds=(1, "any")) is None
    lengths = np.bincount(data.episode, minlength=EPISODES)
    ranked = np.argsort(np.argsort(lengths, kind="stable")).astype(float)
    sorted_ = replace(data, stored=ranked)
    assert sequence_test(sorted_, _nearby_mode(ranked, modes), rows, seeds=(1, "any")) is None
