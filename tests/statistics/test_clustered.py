"""Intervals over clusters: coverage by simulation, no width of zero, and no quantile from luck."""

import math

import numpy as np
import pytest

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.seeds import stream
from genpolicy.statistics.clustered import (
    MINIMUM_CLUSTERS,
    quantile_interval,
    ratio_interval,
)
from genpolicy.statistics.intervals import clopper_pearson, order_statistic_interval


def ratio(hits, whole, seed=1):
    hits, whole = np.asarray(hits, float), np.asarray(whole, float)
    return ratio_interval(hits, whole, confidence=0.95, rng=stream(seed, "ratio"))


def p95(values, clusters, seed=1):
    return quantile_interval(
        np.asarray(values, float), np.asarray(clusters), 0.95,
        confidence=0.95, rng=stream(seed, "quantile"),
    )  # fmt: skip


def test_clusters_that_never_miss_still_have_the_width_of_their_number():
    assert ratio(np.zeros(50), np.full(50, 20.0)) == (0.0, clopper_pearson(0, 50, 0.95)[1])
    assert ratio(np.full(50, 20.0), np.full(50, 20.0)) == (clopper_pearson(50, 50, 0.95)[0], 1.0)


def test_rows_of_one_cluster_are_one_draw():
    # Half of the starts miss everything: 50 draws of a coin, not 1000.
    hits = np.tile([0.0, 20.0], 25)
    lower, upper = ratio(hits, np.full(50, 20.0))
    exact = clopper_pearson(25, 50, 0.95)
    assert lower == pytest.approx(exact[0], abs=0.02) and upper == pytest.approx(exact[1], abs=0.02)


def test_a_share_weighs_clusters_by_their_size():
    hits, whole = [0.0] * 30 + [30.0] * 30, [10.0] * 30 + [30.0] * 30
    lower, upper = ratio(hits, whole)
    assert lower < 0.75 < upper


def test_the_upper_end_covers_a_skewed_share():
    rng, missed = np.random.default_rng(4), 0
    for trial in range(300):
        bad = rng.random(80) < 0.2
        whole = np.where(bad, rng.integers(60, 120, 80), rng.integers(20, 30, 80)).astype(float)
        hits = np.where(bad, 0.6 * whole, 0.02 * whole)
        truth = (0.2 * 0.6 * 89.5 + 0.8 * 0.02 * 24.5) / (0.2 * 89.5 + 0.8 * 24.5)
        missed += ratio(hits, whole, seed=trial)[1] < truth
    # Nominal 2.5 %; a percentile bootstrap of 80 skewed draws is known to fall a little short.
    assert missed / 300 <= 0.06


@pytest.mark.parametrize(("hits", "whole"), [([2], [1]), ([-1], [1]), ([0], [0]), ([], [])])
def test_counts_that_cannot_be_are_refused(hits, whole):
    with pytest.raises(ContractError):
        ratio(hits, whole)


def test_one_row_a_cluster_is_the_exact_interval():
    values = np.random.default_rng(0).normal(size=200)
    assert p95(values, np.arange(200)) == order_statistic_interval(values, 0.95, 0.95)


def test_a_quantile_of_copies_is_no_better_known_than_that_of_its_clusters():
    own = np.random.default_rng(3).normal(size=200)
    exact = order_statistic_interval(own, 0.95, 0.95)
    lower, upper = p95(np.repeat(own, 20), np.repeat(np.arange(200), 20))
    naive = order_statistic_interval(np.repeat(own, 20), 0.95, 0.95)
    assert upper - lower > 2 * (naive[1] - naive[0])
    assert lower == pytest.approx(exact[0], abs=0.15) and upper == pytest.approx(exact[1], abs=0.4)


def test_an_end_that_the_sample_cannot_bound_is_infinite():
    assert p95(np.arange(50), np.arange(50))[1] == math.inf
    few = MINIMUM_CLUSTERS - 1
    assert p95(np.arange(few * 10), np.repeat(np.arange(few), 10)) == (-math.inf, math.inf)


def test_one_slow_cluster_in_twenty_is_p95_by_luck():
    values = np.r_[np.zeros(380), np.arange(1.0, 21.0)]
    lower, upper = p95(values, np.repeat(np.arange(20), 20))
    assert lower == 0.0 and upper >= 10.0


def covers(n, per_cluster, seed):
    """Share of trials in which the upper end covers .95, where a cluster's rows are one value."""
    rng, right = np.random.default_rng(seed), 0
    for trial in range(100):
        own = rng.exponential(size=n)
        upper = p95(np.repeat(own, per_cluster), np.repeat(np.arange(n), per_cluster), trial)[1]
        right += upper >= -math.log(0.05)
    return right / 100


def test_few_clusters_of_one_value_bound_nothing():
    """The largest of 20 is below the 95th percentile in .36 of all draws, whatever is resampled."""
    assert covers(20, 10, seed=6) == 1.0 and covers(60, 10, seed=7) == 1.0
    own = np.random.default_rng(8).normal(size=60)
    assert p95(np.repeat(own, 10), np.repeat(np.arange(60), 10))[1] == math.inf
    assert covers(100, 4, seed=9) >= 0.93


def test_rows_that_do_not_resemble_their_cluster_are_worth_as_many_draws():
    """Thirty clusters of forty independent rows: 1,200 draws, and a finite end close to theirs."""
    values = np.random.default_rng(10).normal(size=1200)
    exact = order_statistic_interval(values, 0.95, 0.95)
    lower, upper = p95(values, np.repeat(np.arange(30), 40))
    assert lower == pytest.approx(exact[0], abs=0.1) and upper == pytest.approx(exact[1], abs=0.15)


def test_same_stream_same_interval_and_nan_is_refused():
    values, clusters = np.random.default_rng(5).normal(size=900), np.repeat(np.arange(90), 10)
    np.random.seed(3)
    assert p95(values, clusters) == p95(values, clusters)
    with pytest.raises(NonFiniteError):
        p95(np.r_[values[:-1], np.nan], clusters)
