"""Alike up to a factor: intervals that cover, and a power that is what a simulation counts."""

import math

import numpy as np
import pytest
from scipy import stats

from genpolicy.errors import ContractError
from genpolicy.seeds import stream
from genpolicy.statistics.equivalence import (
    ratio_of_means,
    ratio_to,
    share_found,
    spread_found,
)

FIRST, SECOND = np.array([0.010, 0.011, 0.0105]), np.array([0.012, 0.0118, 0.0125])


def test_the_interval_is_that_of_a_pooled_t_test_on_logarithms():
    found = ratio_of_means(FIRST, SECOND, confidence=0.95)
    oracle = stats.ttest_ind(np.log(FIRST), np.log(SECOND)).confidence_interval(0.95)
    assert found[1:] == pytest.approx((math.exp(oracle.low), math.exp(oracle.high)))
    assert found[0] == pytest.approx(stats.gmean(FIRST) / stats.gmean(SECOND))
    other = ratio_of_means(SECOND, FIRST, confidence=0.95)
    assert other[1] == pytest.approx(1 / found[2]) and other[2] == pytest.approx(1 / found[1])


def test_pairs_are_held_against_their_own_reference():
    found = ratio_to(FIRST, SECOND, confidence=0.9)
    oracle = stats.ttest_rel(np.log(FIRST), np.log(SECOND)).confidence_interval(0.9)
    assert found[1:] == pytest.approx((math.exp(oracle.low), math.exp(oracle.high)))


def test_equal_numbers_differ_by_nothing():
    same = np.full(3, 0.02)
    assert ratio_of_means(same, same, confidence=0.95) == (1.0, 1.0, 1.0)


def test_it_covers_as_often_as_it_says():
    draws = np.exp(0.2 * stream(7, "equivalence").standard_normal((4000, 2, 3)))
    ends = [ratio_of_means(pair[0], pair[1], confidence=0.9)[1:] for pair in draws]
    covered = np.mean([low <= 1.0 <= high for low, high in ends])
    assert covered == pytest.approx(0.9, abs=0.015)


@pytest.mark.parametrize(
    ("spread", "limit", "count"), [(0.1, 1.5, 3), (0.2, 1.5, 3), (0.1, 1.25, 4)]
)
def test_the_power_is_the_share_that_a_simulation_counts(spread, limit, count):
    draws = np.exp(spread * stream(8, "power").standard_normal((4000, 2, count)))
    ends = [ratio_of_means(pair[0], pair[1], confidence=0.95)[1:] for pair in draws]
    counted = np.mean([1 / limit <= low and high <= limit for low, high in ends])
    assert share_found(spread, limit, count, confidence=0.95) == pytest.approx(counted, abs=0.025)


def test_the_spread_that_is_found_is_found_with_that_power():
    for power in (0.5, 0.8, 0.95):
        spread = spread_found(1.5, 3, confidence=0.95, power=power)
        assert share_found(spread, 1.5, 3, confidence=0.95) == pytest.approx(power)
    assert spread_found(1.5, 4, confidence=0.95) > spread_found(1.5, 3, confidence=0.95)


@pytest.mark.parametrize("values", [[0.01], [0.01, 0.0], [0.01, math.nan], [0.01, -1.0], []])
def test_what_has_no_ratio_is_refused(values):
    with pytest.raises(ContractError, match="a ratio of means"):
        ratio_of_means(np.array(values), SECOND, confidence=0.95)
    with pytest.raises(ContractError, match="a ratio of means"):
        ratio_to(FIRST[: len(values)], np.array(values), confidence=0.95)


def test_every_value_has_its_reference():
    with pytest.raises(ContractError, match="3 values and 2 references"):
        ratio_to(FIRST, SECOND[:2], confidence=0.95)
