"""Conformal thresholds: a golden rank, the false alarm rate by simulation, and what is refused."""

import math

import numpy as np
import pytest

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.statistics.conformal import conformal_rank, conformal_threshold


def test_ranks_by_hand():
    """ceil((n + 1)(1 - alpha)), computed on paper."""
    assert conformal_rank(19, 0.05) == 19  # 20 * 0.95 = 19
    assert conformal_rank(20, 0.05) == 20  # 21 * 0.95 = 19.95
    assert conformal_rank(9, 0.1) == 9  # 10 * 0.9 = 9, which floating point makes 9.000000000000002
    assert conformal_rank(99, 0.1) == 90


def test_threshold_is_an_order_statistic():
    scores = np.arange(1.0, 20.0)[::-1]
    assert conformal_threshold(scores, 0.05) == 19.0
    assert conformal_threshold(scores, 0.5) == 10.0


def test_too_few_scores_allow_no_alarm():
    assert conformal_threshold(np.arange(18.0), 0.05) == math.inf
    assert conformal_threshold(np.array([]), 0.5) == math.inf


@pytest.mark.parametrize(("n", "alpha"), [(20, 0.05), (50, 0.05), (9, 0.1), (33, 0.2)])
def test_false_alarm_rate_by_simulation(n, alpha):
    """At most alpha, and at least alpha less 1 / (n + 1): exact for scores without ties.

    A plain quantile is over alpha for the two sizes at which it was published (0.093 and 0.068).
    """
    rng = np.random.default_rng(3)
    draws = rng.gumbel(size=(20_000, n + 1))
    kept, later = draws[:, :n], draws[:, n]
    above = np.array([conformal_threshold(row, alpha) for row in kept])
    rate, noise = float(np.mean(later > above)), 4 * math.sqrt(alpha / len(draws))
    assert alpha - 1 / (n + 1) - noise <= rate <= alpha + noise
    if alpha == 0.05:
        plain = np.quantile(kept, 1 - alpha, axis=1)
        assert np.mean(later > plain) > alpha + noise


def test_ties_are_no_alarms():
    rng = np.random.default_rng(4)
    draws = rng.integers(0, 3, size=(5000, 21)).astype(float)
    above = np.array([conformal_threshold(row, 0.1) for row in draws[:, :20]])
    assert np.mean(draws[:, 20] > above) <= 0.1


@pytest.mark.parametrize("alpha", [0.0, 1.0, -0.1, math.nan])
def test_no_chance_is_refused(alpha):
    with pytest.raises(ContractError, match="0 < alpha < 1"):
        conformal_threshold(np.arange(5.0), alpha)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_score_that_is_none_is_refused(bad):
    with pytest.raises(NonFiniteError, match="leave no score out"):
        conformal_threshold(np.array([1.0, bad]), 0.5)
