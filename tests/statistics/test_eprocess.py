"""Type I error at the boundary under continuous looking; power; invariances."""

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.seeds import stream
from genpolicy.statistics.eprocess import paired_e_value, power_table, simulate_pairs


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
    # D = 1, margin 0: mean over the grid of 1 + lambda, grid .95 (1..24) / 24.
    grid = 0.95 * np.arange(1, 25) / 24
    assert paired_e_value(np.ones(1), margin=0.0, alpha=0.05).path[0] == pytest.approx(
        np.mean(1 + grid)
    )


@pytest.mark.parametrize("bad", [[1.5], [np.nan]])
def test_values_outside_the_range_are_refused(bad):
    with pytest.raises(ContractError, match="the differences"):
        paired_e_value(np.array(bad), margin=0.0, alpha=0.05)
