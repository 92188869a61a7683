"""Coverage by simulation, golden values, refusals."""

import math

import numpy as np
import pytest

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import (
    clopper_pearson,
    order_statistic_interval,
)


def test_clopper_pearson_golden():
    # Closed forms of the ends: 0 of n has upper 1 - (alpha/2)^(1/n); n of n mirrored.
    assert clopper_pearson(0, 10) == (0.0, pytest.approx(1 - 0.025 ** (1 / 10)))
    assert clopper_pearson(10, 10) == (pytest.approx(0.025 ** (1 / 10)), 1.0)
    assert clopper_pearson(0, 0) == (0.0, 1.0)
    # Newcombe 1998, table I: 81 of 263.
    assert clopper_pearson(81, 263) == (
        pytest.approx(0.2527, abs=1e-4),
        pytest.approx(0.3676, abs=1e-4),
    )


@pytest.mark.parametrize("probability", [0.02, 0.3, 0.5, 0.9])
@pytest.mark.parametrize("n", [7, 40])
def test_clopper_pearson_covers_exactly(probability, n):
    from scipy.stats import binom

    covered = sum(
        binom.pmf(k, n, probability)
        for k in range(n + 1)
        if clopper_pearson(k, n)[0] <= probability <= clopper_pearson(k, n)[1]
    )
    assert covered >= 0.95 - 1e-12


def test_impossible_counts_are_refused():
    with pytest.raises(ContractError, match="3 successes of 2"):
        clopper_pearson(3, 2)


@pytest.mark.parametrize("quantile", [0.5, 0.9])
def test_order_statistic_interval_covers(quantile):
    rng = stream(1, "order", str(quantile))
    truth = -math.log(1 - quantile)
    hits = 0
    for _ in range(600):
        low, high = order_statistic_interval(rng.exponential(size=60), quantile)
        hits += low <= truth <= high
    assert hits / 600 >= 0.93


def test_order_statistic_interval_says_when_the_sample_is_too_small():
    low, high = order_statistic_interval(np.arange(10.0), 0.95)
    assert high == math.inf and low <= 9.0
    assert order_statistic_interval(np.array([]), 0.5) == (-math.inf, math.inf)
    with pytest.raises(NonFiniteError):
        order_statistic_interval(np.array([1.0, np.nan]), 0.5)
