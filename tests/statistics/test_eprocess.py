"""Type I error at the boundary under continuous looking; power; invariances."""

import itertools

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.seeds import stream
from genpolicy.statistics.eprocess import (
    gain_interval,
    highest_e_value,
    paired_e_value,
    power_table,
    simulate_pairs,
)


@pytest.mark.parametrize("margin", [-0.1, 0.0, 0.1])
def test_wrong_promotions_stay_below_alpha_at_the_boundary(margin):
    rng = stream(5, "type one", str(margin))
    row = power_table(
        [(0.6, 0.6 + margin)],
        margin=margin,
        alpha=0.05,
        pairs=200,
        correlation=0.6,
        trials=1500,
        rng=rng,
    )[0]
    assert row.promote_share <= 0.05


def test_power_golden():
    # Independent simulation (.6 against .8, correlation .6) gave a median of 44 pairs.
    row = power_table(
        [(0.6, 0.8)],
        margin=0.0,
        alpha=0.05,
        pairs=400,
        correlation=0.6,
        trials=400,
        rng=stream(6, "power"),
    )[0]
    assert row.promote_share > 0.98
    assert 25 <= row.median_pairs <= 60
    assert row.promote_share + row.return_share == pytest.approx(1.0)


def test_the_path_is_causal_and_the_decision_follows_it():
    d = simulate_pairs(0.5, 0.9, correlation=0.5, shape=(1, 80), rng=stream(7, "path"))[0]
    whole = paired_e_value(d, margin=0.0, alpha=0.05)
    assert whole.decision == "promote"
    part = paired_e_value(d[: whole.pairs_needed - 1], margin=0.0, alpha=0.05)
    assert part.decision == "continue" and part.pairs_needed is None
    assert np.array_equal(part.path, whole.path[: len(part.path)])
    assert paired_e_value(-d, margin=0.0, alpha=0.05).decision == "continue"
    assert paired_e_value(np.array([]), margin=0.0, alpha=0.05).e_value == 1.0


def test_one_pair_by_hand():
    # D = 1, margin 0.05: mean over the wagers of 1 + share / 1.05 * 0.95.
    wagers = np.array([0.35, 0.45, 0.55, 0.65, 0.75, 0.85]) / 1.05
    assert paired_e_value(np.ones(1), margin=0.05, alpha=0.05).path[0] == pytest.approx(
        np.mean(1 + 0.95 * wagers)
    )


def test_a_gain_of_three_tenths_is_found_on_ninety_starts():
    # Twenty-four wagers from 0.04 up found it in 0.83 of trials, in 0.77 on eighty starts.
    row = power_table(
        [(0.5, 0.8)], margin=0.05, alpha=0.05 / 3, pairs=90, correlation=0.3, trials=4000,
        rng=stream(8, "power"),
    )[0]  # fmt: skip
    assert row.promote_share >= 0.84


def test_averages_over_conditions_keep_the_error_at_the_margin():
    """Pairs of a real trial are means over conditions, not coins; few starts gain."""
    rng, wrong = np.random.default_rng(9), 0
    for _ in range(1500):
        d = np.where(rng.random(90) < 0.1, 0.8, rng.choice([-0.2, 0.0, 0.1], size=90))
        d += 0.05 - (0.08 + 0.9 * (-0.1 / 3))
        wrong += paired_e_value(np.clip(d, -1, 1), margin=0.05, alpha=0.05).decision == "promote"
    assert wrong / 1500 <= 0.05


@pytest.mark.parametrize("bad", [[1.5], [np.nan]])
def test_values_outside_the_range_are_refused(bad):
    with pytest.raises(ContractError, match="the differences"):
        paired_e_value(np.array(bad), margin=0.0, alpha=0.05)


# -- the interval of a gain -----------------------------------------------------------------------


@pytest.mark.parametrize("gain", [-0.3, 0.0, 0.25])
def test_an_interval_holds_the_gain_that_is_true(gain):
    rng = stream(9, "interval", str(gain))
    missed, trials = 0, 200
    for d in simulate_pairs(0.5, 0.5 + gain, correlation=0.5, shape=(trials, 60), rng=rng):
        low, high = gain_interval(d, alpha=0.05)
        missed += not low <= gain <= high
    assert missed <= 0.1 * trials


def test_both_ends_by_their_definition_and_mirrored():
    d = simulate_pairs(0.4, 0.8, correlation=0.5, shape=(1, 90), rng=stream(10, "ends"))[0]
    low, high = gain_interval(d, alpha=0.025)
    assert -1 < low < d.mean() < high < 1
    for margin, decision in ((low, "promote"), (low + 0.001, "continue")):
        assert paired_e_value(d, margin=margin, alpha=0.025).decision == decision
    assert gain_interval(-d, alpha=0.025) == (-high, -low)
    wider = gain_interval(d, alpha=0.005)
    assert wider[0] < low and wider[1] > high


def test_of_few_pairs_nothing_is_said():
    assert gain_interval(np.zeros(0), alpha=0.025) == (-1.0, 1.0)
    low, high = gain_interval(np.ones(2), alpha=0.025)
    assert low < 0 and high == 1.0
    with pytest.raises(ContractError):
        gain_interval(np.array([np.nan]), alpha=0.025)


@pytest.mark.parametrize("margin", [-0.1, 0.0, 0.1])
def test_no_rest_leads_to_more_evidence_than_one_that_is_all_won(margin):
    """Also of graded differences; and what can be reached only falls with what is known."""
    rng = stream(9, "highest", f"{margin:g}")
    for _ in range(50):
        pairs = np.clip(rng.normal(0.1, 0.6, 30), -1.0, 1.0)
        reached = [highest_e_value(pairs[:n], margin=margin, left=30 - n) for n in range(31)]
        assert all(later <= earlier for earlier, later in itertools.pairwise(reached))
        whole = paired_e_value(pairs, margin=margin, alpha=0.05)
        assert reached[-1] == whole.e_value
        won = np.concatenate([pairs[:10], np.ones(20)])
        assert reached[10] == paired_e_value(won, margin=margin, alpha=0.05).e_value


def test_what_can_be_reached_is_the_largest_evidence_and_not_the_last():
    won_then_lost = np.concatenate([np.ones(12), -np.ones(12)])
    shown = paired_e_value(won_then_lost[:12], margin=0.0, alpha=0.05).e_value
    assert highest_e_value(won_then_lost, margin=0.0, left=3) == shown > 20.0
    assert highest_e_value(np.zeros(0), margin=0.0, left=0) == 1.0
    with pytest.raises(ContractError, match="the differences"):
        highest_e_value(np.array([1.5]), margin=0.0, left=1)
