"""Two ways of doing the same units: shown alike, shown to differ, or neither."""

import numpy as np
import pytest
from scipy import stats

from genpolicy.errors import ContractError
from genpolicy.seeds import stream
from genpolicy.statistics.clustered import MINIMUM_CLUSTERS
from genpolicy.statistics.intervals import clopper_pearson
from genpolicy.statistics.two_samples import distance_interval, share_difference

UNITS, OF = 48, 4


def distance(first, second, *, seed=0):
    return distance_interval(first, second, confidence=0.9, rng=stream(seed, "test"))


def difference(first, second, *, seed=0):
    whole = np.full(len(first), float(OF))
    return share_difference(
        (np.asarray(first, float), whole), (np.asarray(second, float), whole),
        confidence=0.9, rng=stream(seed, "test"),
    )  # fmt: skip


def test_the_distance_is_that_of_kolmogorov_and_smirnov():
    draw = np.random.default_rng(1)
    values = draw.integers(0, 6, (2, UNITS, OF))
    counts = [np.stack([(each == v).sum(axis=1) for v in range(6)], axis=1) for each in values]
    point, low, high = distance(counts[0].astype(float), counts[1].astype(float))
    assert point == pytest.approx(
        stats.ks_2samp(values[0].ravel(), values[1].ravel(), method="asymp").statistic
    )
    assert low <= point <= high


def test_what_never_differed_is_known_as_well_as_so_many_units_know_it():
    """Golden: 1 - 0.05 ** (1 / 48), the exact one-sided bound of none of 48."""
    counts = np.tile([1.0, 3.0], (UNITS, 1))
    unseen = clopper_pearson(0, UNITS, 0.9)[1]
    assert unseen == pytest.approx(1.0 - 0.05 ** (1.0 / UNITS))
    assert distance(counts, counts) == (0.0, 0.0, pytest.approx(unseen))
    assert difference([0] * UNITS, [0] * UNITS) == (0.0, pytest.approx(-unseen), unseen)


def test_few_units_tell_nothing():
    few = MINIMUM_CLUSTERS - 1
    counts = np.tile([1.0, 3.0], (few, 1))
    assert distance(counts, counts)[1:] == (0.0, 1.0)
    assert difference([0] * few, [0] * few)[1:] == (-1.0, 1.0)


def test_one_unit_of_all_misses_is_one_unit():
    """As many misses, all in a quarter of the units: their rows are no independent ones."""
    heaped = difference([OF] * 12 + [0] * (UNITS - 12), [0] * UNITS)
    spread = difference([1] * UNITS, [0] * UNITS)
    assert heaped[0] == spread[0] == 0.25
    assert heaped[1] < spread[1] and spread[2] < heaped[2]


def test_pairs_know_more_than_two_samples():
    """The same hard units both ways: the difference is known, though neither share is."""
    hard = [OF, 0] * (UNITS // 2)
    unseen = clopper_pearson(0, UNITS, 0.9)[1]
    assert difference(hard, hard)[1:] == pytest.approx((-unseen, unseen))


def test_a_true_difference_is_covered_and_one_at_the_tolerance_is_called_alike_by_few():
    """Rate of false equivalence at the tolerance itself: nominally 0.05."""
    draw, alike, covered, trials = np.random.default_rng(3), 0, 0, 200
    for trial in range(trials):
        base = draw.beta(2, 6, UNITS)
        first, second = draw.binomial(OF, np.minimum(base + 0.1, 1)), draw.binomial(OF, base)
        _, low, high = difference(first, second, seed=trial)
        alike += -0.1 <= low <= high <= 0.1
        covered += low <= 0.1 <= high
    assert alike <= stats.binom.isf(1e-3, trials, 0.07)
    assert covered >= 0.85 * trials


def test_the_same_stream_gives_the_same_interval():
    hits = np.arange(UNITS) % (OF + 1)
    assert difference(hits, hits[::-1]) == difference(hits, hits[::-1])


def test_nothing_to_compare_is_refused():
    none = np.zeros((UNITS, 2))
    with pytest.raises(ContractError, match="values on both sides"):
        distance(none, np.ones((UNITS, 2)))
    with pytest.raises(ContractError, match="cases on both sides"):
        share_difference(
            (np.zeros(3), np.zeros(3)),
            (np.zeros(3), np.ones(3)),
            confidence=0.9,
            rng=stream(0, "t"),
        )
