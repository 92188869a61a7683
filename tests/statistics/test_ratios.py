"""The ratio of sums: by hand, covering by simulation, and refusing what is no ratio."""

import math

import numpy as np
import pytest
from scipy import stats

from genpolicy.errors import ContractError
from genpolicy.statistics.ratios import ratio_of_sums


def test_by_hand():
    """Sums 6 and 12, ratio 1/2; rests 0.5, 0, -0.5; mean of the denominator 4."""
    ratio, lower, upper = ratio_of_sums(
        np.array([1.5, 2.0, 2.5]), np.array([2.0, 4.0, 6.0]), confidence=0.95
    )
    error = math.sqrt(0.5 / 6) / 4
    assert ratio == pytest.approx(0.5)
    assert (
        upper - ratio
        == pytest.approx(ratio - lower)
        == pytest.approx(stats.t.isf(0.025, 2) * error)
    )


def test_equal_clusters_leave_no_doubt():
    assert ratio_of_sums(np.full(9, 3.0), np.full(9, 4.0), confidence=0.95) == (0.75, 0.75, 0.75)


def test_it_covers_the_true_ratio_of_paired_losses():
    """Losses of 40 episodes differ by a factor of two and fall by 10 % give or take 5."""
    generator = np.random.default_rng(3)
    covered = 0
    for _ in range(2000):
        before = generator.lognormal(0.0, 0.5, 40)
        after = before * (0.9 + 0.05 * generator.standard_normal(40))
        _, lower, upper = ratio_of_sums(after, before, confidence=0.95)
        covered += lower <= 0.9 <= upper
    assert 0.92 <= covered / 2000 <= 0.97


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [([1.0], [1.0]), ([1.0, 2.0], [1.0]), ([1.0, math.nan], [1.0, 1.0]), ([1.0, 1.0], [0.0, 0.0])],
)
def test_what_is_no_ratio_is_refused(numerator, denominator):
    with pytest.raises(ContractError, match="a ratio of sums"):
        ratio_of_sums(np.array(numerator), np.array(denominator), confidence=0.95)
