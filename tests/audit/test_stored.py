"""The place in the files tells of a pattern, and of nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from planar import planar

from genpolicy.audit.choices import Choices
from genpolicy.audit.data import canonical
from genpolicy.audit.stored import LEVEL, OPEN_LEVEL, places, sequence_hits, sequence_test
from genpolicy.seeds import stream

EPISODES = 120


def drawn(seed, modes, order=None):
    """Data with places, the mode of each episode, and rows of one situation each of five."""
    data = canonical(planar(episodes=EPISODES, seed=1)[0])
    stored = np.arange(EPISODES, dtype=float) if order is None else np.asarray(order, dtype=float)
    data = replace(
        data, stored=stored, episodes=replace(data.episodes, outcome=np.full(EPISODES, "success"))
    )
    rows = np.flatnonzero(data.index == 0)
    blocks = stream(seed, "situations").integers(0, 5, EPISODES)
    return data, modes, (rows, modes, blocks)


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
    data, links, rows = drawn(1, modes, order)
    test = sequence_test(data, data.stored, links, rows, seeds=(1, "any"))
    assert test is not None and test.effect > 0.3 and test.p_value <= LEVEL
    # Who has no mode says nothing.
    links = np.full(EPISODES, -1)
    assert sequence_test(data, data.stored, links, rows, seeds=(1, "any")) is None


def test_episodes_dealt_to_their_places_have_none():
    found = 0
    for seed in range(40):
        modes = stream(seed, "dealt").permutation(in_turns(seed))
        data, links, rows = drawn(seed, modes)
        found += sequence_test(data, data.stored, links, rows, seeds=(seed, "any")) is not None
    assert found <= 1 and LEVEL < 0.01


def test_what_is_sorted_by_length_or_outcome_is_no_sequence():
    modes = (np.arange(EPISODES) >= EPISODES // 2).astype(int)
    data, links, rows = drawn(2, modes)

    def asked(data):
        return sequence_test(data, data.stored, links, rows, seeds=(1, "any"))

    assert asked(data) is not None
    outcome = np.where(modes == 1, "failure", "success")
    assert asked(replace(data, episodes=replace(data.episodes, outcome=outcome))) is None
    lengths = np.bincount(data.episode, minlength=EPISODES)
    ranked = np.argsort(np.argsort(lengths, kind="stable")).astype(float)
    assert asked(replace(data, stored=ranked)) is None
    assert sequence_hits(data, ranked, chosen(modes), seeds=(1, "any")) is None


def chosen(modes):
    """Everybody chose between two modes, at one of two starts."""
    start = np.arange(EPISODES) % 2
    share = np.zeros((EPISODES, 4))
    for side in (0, 1):
        share[np.arange(EPISODES), 2 * start + side] = 0.5
    return Choices(np.arange(EPISODES), 2 * start + (modes ^ start), share)


def test_neighbours_tell_what_was_decided_per_session_and_nothing_of_dealt_modes():
    data, _, _ = drawn(1, in_turns(0))
    near, nearest, believed = sequence_hits(
        data, data.stored, chosen(in_turns(0)), seeds=(1, "any")
    )
    assert believed and near.mean() > 0.8 and nearest.mean() > 0.7
    found = 0
    for seed in range(40):
        dealt = chosen(stream(seed, "dealt").permutation(in_turns(seed)))
        found += sequence_hits(data, data.stored, dealt, seeds=(seed, "any")) is not None
    assert found <= 2 and OPEN_LEVEL < 0.05
