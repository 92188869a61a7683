"""Persistence: episodes that stay with their cluster, against chunks dealt at random."""

import numpy as np
import pytest
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.persistence import (
    Persistence,
    kept_identity,
    persistent,
    shares,
    summarise,
    von_neumann,
)
from genpolicy.seeds import stream

NULL = np.linspace(0.0, 0.99, 100)


@pytest.fixture(scope="module")
def data():
    return canonical(planar(episodes=24, seed=5)[0])


def measured(data, row, labels):
    members = np.flatnonzero(data.index == row)
    situation = Neighbourhood(int(members[-1]), members[:-1], np.zeros(len(members) - 1))
    clustering = Clustering(labels, 0.1, (0, 1))
    return kept_identity(data, SETTINGS, situation, clustering, rng=stream(1, "null"))


def sides(data):
    """The side of the post on which each episode passes."""
    at = np.flatnonzero(data.index == 12)
    return (data.action[at, 1] > 0).astype(int)


def test_a_way_around_the_post_keeps_its_episodes_and_a_deal_does_not(data):
    share, null = measured(data, 2, sides(data))
    assert share == 1.0 and null.shape == (99,)
    assert persistent((share, null))
    dealt = stream(2, "dealt").permutation(sides(data))
    assert not persistent(measured(data, 2, dealt))


def test_episodes_that_end_too_soon_say_nothing(data):
    last = int(data.index.max())
    labels = np.arange(np.count_nonzero(data.index == last - 2)) % 2
    assert measured(data, last - 2, labels) is None


def test_one_situation_persists_only_beyond_its_own_null():
    limit = float(np.quantile(NULL, 0.95))
    assert persistent((limit + 1e-9, NULL)) and not persistent((limit, NULL))
    assert not persistent(None) and not persistent((float("nan"), NULL))


def test_the_summary_is_the_mean_over_what_could_be_measured():
    found = summarise([(0.8, NULL), None, (0.6, NULL + 0.2)])
    assert found.observed == pytest.approx(0.7) and found.n == 2
    assert found.null_mean == pytest.approx(NULL.mean() + 0.1)
    assert found.null_q95 == pytest.approx(np.quantile(NULL, 0.95) + 0.1)
    assert summarise([None]) == Persistence(0.0, 1.0, 1.0, 0)


def test_the_ratio_of_von_neumann_is_two_for_an_alternation_and_one_for_white_noise():
    # By hand: +a and -a in turn differ by 2a, so their squared differences are 4a^2 = 4 * power.
    signs = np.tile([1.0, -1.0], 8)[None, :, None] * np.array([1.0, -1.0])[:, None, None]
    ratio, rms = von_neumann(0.003 * signs)
    assert (ratio, rms) == (pytest.approx(2.0), pytest.approx(0.003))
    white = stream(3, "white").normal(size=(200, 64, 2))
    assert von_neumann(white)[0] == pytest.approx(1.0, abs=0.05)
    smooth = np.linspace(-1, 1, 64)[None, :, None] * np.array([1.0, -1.0])[:, None, None]
    assert von_neumann(smooth)[0] < 0.01
    assert von_neumann(np.ones((5, 16, 2))) == (0.0, 0.0)


def test_shares_are_those_of_one_dealing_after_the_other():
    """By hand: each chunk against the mean distance to every cluster, itself left out."""
    rng = stream(4, "shares")
    gaps = np.abs(rng.normal(size=(9, 9)))
    gaps += gaps.T
    np.fill_diagonal(gaps, 0.0)
    labels = np.array([0, 0, 0, 0, 1, 1, 1, 2, 2])
    deals = np.stack([labels, *(rng.permutation(labels) for _ in range(5))])
    expected = []
    for deal in deals:
        right = 0
        for chunk, own in enumerate(deal):
            others = np.arange(9) != chunk
            means = [gaps[chunk, others & (deal == kind)].mean() for kind in range(3)]
            right += int(np.argmin(means)) == own
        expected.append(right / 9)
    assert shares(gaps, deals).tolist() == expected


def test_a_cluster_of_one_is_nobodys_own():
    gaps = np.array([[0.0, 1.0, 2.0], [1.0, 0.0, 2.0], [2.0, 2.0, 0.0]])
    assert shares(gaps, np.array([[0, 0, 1]])).tolist() == [2 / 3]
