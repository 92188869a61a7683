"""Intervals and components of what is measured in every combination of draws."""

import math

import numpy as np
import pytest
import scipy

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.seeds import stream
from genpolicy.statistics.crossed import (
    components,
    gain_of_methods,
    mean_interval,
    mean_width,
    trainings_width,
)

ALPHA = 0.025


def test_golden_interval_of_two_trainings_that_lie_apart():
    """By hand: means .2 and .6 of two, so that sd is .2 * sqrt(2) and half the width t(1) * .2."""
    values = np.array([[0.2, 0.2, 0.2], [0.6, 0.6, 0.6]])
    mean, low, high = mean_interval(values, alpha=ALPHA)
    assert mean == pytest.approx(0.4)
    width = 12.706205 * 0.2
    assert (low, high) == pytest.approx((0.4 - width, 0.4 + width), abs=1e-5)


def test_widths_of_trainings_and_starts_add_by_their_squares():
    rng = stream(0, "crossed", "squares")
    values = rng.random((4, 30))
    whole = mean_interval(values, alpha=ALPHA)[2] - values.mean()
    starts = mean_width(values.mean(axis=0), alpha=ALPHA)
    assert whole == pytest.approx(math.hypot(trainings_width(values, alpha=ALPHA), starts))
    by_hand = scipy.stats.t.isf(ALPHA, 29) * values.mean(axis=0).std(ddof=1) / math.sqrt(30)
    assert starts == pytest.approx(by_hand)


def test_trainings_that_are_alike_by_luck_are_taken_as_apart_as_their_noise():
    """Both win on half of the starts, on others: equal means say little of a third training."""
    won = np.arange(20) % 2
    values = np.stack([won, 1 - won]).astype(float)
    assert values.mean(axis=1).tolist() == [0.5, 0.5]
    noise = 0.5 / math.sqrt(20) * math.sqrt(20 / 19)  # of a mean over twenty starts
    width = scipy.stats.t.isf(ALPHA, 1) * noise
    assert trainings_width(values, alpha=ALPHA) == pytest.approx(width, rel=0.1)


def test_one_training_or_one_start_has_no_interval():
    for shape in ((1, 20), (3, 1)):
        assert mean_interval(np.zeros(shape), alpha=ALPHA)[1:] == (-math.inf, math.inf)
    with_one = gain_of_methods(np.ones((1, 9)), np.zeros((3, 9)), alpha=ALPHA)
    assert with_one[1:] == (-math.inf, math.inf)


def test_a_gain_over_what_has_no_training_is_as_wide_as_the_trainings_of_one():
    rng = stream(0, "crossed", "gain")
    own, planner = rng.random((3, 40)), np.full((1, 40), 0.5)
    assert gain_of_methods(own, planner, alpha=ALPHA) == pytest.approx(
        tuple(np.subtract(mean_interval(own, alpha=ALPHA), 0.5))
    )
    other = rng.random((3, 40))
    wide = gain_of_methods(own, other, alpha=ALPHA)
    starts = mean_width(own.mean(axis=0) - other.mean(axis=0), alpha=ALPHA)
    each = [trainings_width(of, alpha=ALPHA) for of in (own, other)]
    assert wide[2] - wide[0] == pytest.approx(math.sqrt(starts**2 + each[0] ** 2 + each[1] ** 2))


def drawn(rng, trainings, starts, conditions):
    """Successes of trainings, starts and chance, on a logit scale."""
    apart = rng.normal(0, 0.5, (trainings, 1)) + rng.normal(0, 1, starts) + 1.0
    likely = 1 / (1 + np.exp(-apart))
    return (rng.random((trainings, starts, conditions)) < likely[..., None]).mean(axis=2)


def test_the_interval_covers_where_trainings_scatter_normally_and_starts_alone_do_not():
    """600 trials of 3 trainings: each end errs at most as often as it may, within 4 sigma."""
    rng = stream(0, "crossed", "covers")
    both_apart = rng.normal(1.0, math.hypot(0.5, 1.0), 400_000)
    truth = float(np.mean(1 / (1 + np.exp(-both_apart))))
    both, starts_only = np.zeros(2), 0
    for _ in range(600):
        values = drawn(rng, 3, 60, 6)
        mean, low, high = mean_interval(values, alpha=ALPHA)
        both += (low > truth, high < truth)
        starts_only += abs(mean - truth) > mean_width(values.mean(axis=0), alpha=ALPHA)
    most = 600 * ALPHA + 4 * math.sqrt(600 * ALPHA)
    assert both.max() <= most
    assert starts_only > 2 * most


def test_components_of_what_only_adds_up_are_the_scatter_of_each():
    rng = stream(0, "crossed", "adds")
    parts = [rng.normal(0, scale, size) for scale, size in ((0.3, 4), (0.2, 9), (0.1, 5))]
    values = parts[0][:, None, None] + parts[1][:, None] + parts[2]
    found = components(values)
    each = (found.training, found.start, found.condition)
    assert each == pytest.approx([part.std(ddof=1) for part in parts])
    assert found.rest == pytest.approx(0.0, abs=1e-6)  # the root of what rounding leaves


def test_components_of_noise_alone_are_noise():
    rng = stream(0, "crossed", "noise")
    found = [components(rng.normal(0, 0.4, (3, 60, 6))) for _ in range(50)]
    assert np.mean([one.rest for one in found]) == pytest.approx(0.4, rel=0.02)
    for name in ("training", "start", "condition"):
        assert np.mean([getattr(one, name) ** 2 for one in found]) < 0.05 * 0.4**2


@pytest.mark.parametrize("values", [np.zeros(3), np.zeros((0, 3)), np.zeros((2, 3, 4))])
def test_what_is_no_table_is_refused(values):
    with pytest.raises(ContractError):
        mean_interval(values, alpha=ALPHA)
    with pytest.raises(ContractError):
        components(values if values.ndim < 3 else values[:1])


def test_other_starts_and_missing_numbers_are_refused():
    with pytest.raises(ContractError, match="starts of one"):
        gain_of_methods(np.zeros((2, 5)), np.zeros((2, 6)), alpha=ALPHA)
    with pytest.raises(NonFiniteError):
        mean_interval(np.array([[0.1, math.nan], [0.2, 0.3]]), alpha=ALPHA)
