"""Effects: paired by episode, exact on hand-made rows, covering by simulation."""

import math

import numpy as np
import pytest
from scipy import stats

from genpolicy.evidence.need.effects import Compared, effect_rows, half_width, valid
from genpolicy.evidence.rows.need import FactorErrorRow, FactorModeRow


def error(variant, episode, value):
    return FactorErrorRow(variant, "trunk", 0, "direct", "test", episode, 3, value, value / 2)


def situation(variant, episode, covered, admissible, present=2):
    return FactorModeRow(
        variant=variant, factor="trunk", method="chunked_bc", seed=0, convention="direct",
        episode_uuid=episode, index=0, samples=4, modes_present=present, modes_covered=covered,
        between_modes=0, far_from_modes=0, admissible=admissible, valid=0, modes_valid=0,
        fewest_admissible=0, nfe=1, spread_m=0.0,
    )  # fmt: skip


def measured(errors, modes, kind="chunk_error"):
    compared = Compared(
        "b", "direct", "trunk", reference=("a", "direct"), error=kind, confidence=0.95
    )
    return {row.measure: row for row in effect_rows(errors, modes, compared)}


def test_pairs_by_episode_and_leaves_out_what_has_no_partner():
    """Golden: differences 0.1 and 0.3, mean 0.2; half width by hand."""
    errors = [
        error("a", "e1", 1.0), error("a", "e2", 5.0), error("b", "e2", 5.3),
        error("b", "e1", 1.1), error("b", "e3", 99.0),
    ]  # fmt: skip
    found = measured(errors, [])["chunk_error"]
    half = stats.t.isf(0.025, 1) * np.std([0.1, 0.3], ddof=1) / math.sqrt(2)
    assert found.effect == pytest.approx(0.2)
    assert found.upper - found.lower == pytest.approx(2 * half)
    assert (found.episodes, found.reference) == (2, 3.0)
    assert measured(errors, [], "first_error")["first_error"].effect == pytest.approx(0.1)


def test_an_interval_covers_what_it_is_asked_to():
    gains = np.array([0.1, 0.3, 0.2])
    quantiles = {0.95: 4.303, 0.8: 1.886}  # of t with two degrees of freedom, both sides
    for confidence, quantile in quantiles.items():
        half = quantile * 0.1 / math.sqrt(3)
        assert half_width(gains, confidence) == pytest.approx(half, rel=1e-3)


def test_situations_with_one_mode_do_not_count_and_nothing_measured_is_nan():
    modes = [
        situation("a", "e1", 1, 4), situation("b", "e1", 2, 4), situation("a", "e2", 1, 4),
        situation("b", "e2", 1, 0), situation("a", "e3", 1, 4, present=1),
        situation("b", "e3", 1, 4, present=1),
    ]  # fmt: skip
    found = measured([], modes)
    assert (found["mode_coverage"].value, found["mode_coverage"].effect) == (0.75, 0.25)
    assert (found["valid_share"].value, found["valid_share"].effect) == (0.5, -0.5)
    assert math.isnan(found["chunk_error"].effect) and found["chunk_error"].episodes == 0


@pytest.mark.parametrize(
    ("covered", "admissible", "expected"), [(1, 4, 1.0), (1, 3, 0.75), (0, 4, 0.0), (2, 4, 1.0)]
)
def test_valid_needs_a_mode_and_counts_samples_that_pass_all_layers(covered, admissible, expected):
    assert valid(situation("a", "e", covered, admissible)) == expected


def test_intervals_cover_by_simulation():
    """2000 draws of 30 normal differences around 1: the 95 % interval covers, within its noise."""
    rng = np.random.default_rng(0)
    draws = rng.normal(1.0, 2.0, (2000, 30))
    covered = sum(abs(row.mean() - 1.0) <= half_width(row, 0.95) for row in draws)
    assert 0.935 < covered / 2000 < 0.965
