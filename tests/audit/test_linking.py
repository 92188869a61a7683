"""Linking: modes of episodes over situations, by pairs and, for many episodes, carried along."""

import numpy as np
import pytest

from genpolicy.audit.linking import alternatives, carried, link, paired
from genpolicy.audit.modes import by_size
from genpolicy.seeds import stream


def test_linking_follows_modes_through_overlapping_situations():
    rng = stream(24, "link")
    side = rng.integers(0, 2, 60)
    seen = [np.sort(rng.choice(50, 15, replace=False)) for _ in range(30)]
    # Local names are arbitrary, and one situation in thirty is dealt at random.
    memberships = [(s, side[s] ^ int(rng.integers(0, 2))) for s in seen]
    memberships[3] = (seen[3], rng.integers(0, 2, 15))
    groups = link(memberships, 60, 4)
    assert set(groups[:50].tolist()) <= {-1, 0, 1} and np.all(groups[50:] == -1)
    for group in (0, 1):
        assert len(set(side[:50][groups[:50] == group].tolist())) == 1


def chain(rng, *, episodes=300, situations=200, kinds=3, wrong=0.03):
    """Situations of neighbouring episodes whose local names are dealt anew, some members wrong."""
    truth = rng.integers(0, kinds, episodes)
    memberships = []
    for start in np.linspace(0, episodes - 30, situations).astype(int):
        members = start + np.sort(rng.choice(30, 16, replace=False))
        labels = rng.permutation(kinds)[truth[members]]
        swap = rng.random(16) < wrong
        labels = np.where(swap, rng.integers(0, kinds, 16), labels)
        memberships.append((members, labels))
    return truth, memberships


def purity(groups, truth, memberships):
    """Share of episodes whose group is mostly of their truth, and the number of groups."""
    seen = np.unique(np.concatenate([members for members, _ in memberships]))
    groups, truth = groups[seen], truth[seen]
    sizes = [np.bincount(truth[groups == g]).max() for g in np.unique(groups)]
    return sum(sizes) / len(truth), len(sizes)


@pytest.mark.parametrize("kinds", [2, 3, 4])
def test_modes_are_carried_along_a_chain(kinds):
    truth, memberships = chain(stream(30, "chain", kinds), kinds=kinds)
    share, count = purity(carried(memberships, len(truth)), truth, memberships)
    assert count == kinds
    assert share >= 0.97


def test_both_ways_agree_where_everything_overlaps():
    rng = stream(31, "agree")
    truth = rng.integers(0, 2, 60)
    seen = [np.sort(rng.choice(60, 20, replace=False)) for _ in range(60)]
    memberships = [(s, truth[s] ^ int(rng.integers(0, 2))) for s in seen]
    assert np.array_equal(by_size(carried(memberships, 60)), by_size(paired(memberships, 60)))


def test_places_that_share_nothing_keep_their_own_modes():
    left, right = np.arange(10), np.arange(10, 20)
    labels = np.array([0, 1] * 5)
    groups = carried([(left, labels), (right, labels), (left, 1 - labels)], 20)
    assert len(np.unique(groups[:10])) == len(np.unique(groups[10:])) == 2
    assert not set(groups[:10].tolist()) & set(groups[10:].tolist())


def test_many_episodes_need_no_table_of_pairs(monkeypatch):
    truth, memberships = chain(stream(32, "many"), episodes=3000, situations=2000, kinds=2)

    def refuse(*_):
        raise AssertionError("quadratic")

    monkeypatch.setattr("genpolicy.audit.linking.paired", refuse)
    share, count = purity(link(memberships, 3000, 6), truth, memberships)
    assert count == 2 and share >= 0.97


def test_alternatives_are_modes_beside_each_other_and_not_those_of_another_start():
    modes = np.array([0, 0, 1, 1, 2, 2, 3, 3, -1])
    near = (np.array([0, 1, 2, 3, 8]), np.array([0, 0, 1, 1, 1]))
    far = (np.array([4, 5, 6, 7]), np.array([1, 1, 0, 0]))
    alone = (np.array([0, 8]), np.array([0, 1]))
    found = alternatives([near, far, far, alone], modes)
    assert found == {(0, 1): 1, (2, 3): 2}
    assert alternatives([], modes) == {}
