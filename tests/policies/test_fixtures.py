"""Samples that must come back after reload."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.policies.fixtures import (
    CANDIDATES,
    compare_fixtures,
    fixture_observations,
    fixture_rows,
    reload_fixture,
)


@pytest.fixture(scope="module")
def rows(policy, data, kit):
    seen = fixture_observations(data, horizons=kit.HORIZONS, count=5)
    return fixture_rows(policy, seen, method="flow", seed=0)


def test_observations_are_spread_over_the_test_split(data, kit):
    seen = fixture_observations(data, horizons=kit.HORIZONS, count=7)
    cut = data.windows(
        "test", observation_horizon=2, prediction_horizon=1, only_success=False
    ).observations
    assert seen.shape == (7, 2, 24)
    np.testing.assert_array_equal(seen[0], cut[0])
    np.testing.assert_array_equal(seen[-1], cut[-1])


def test_a_row_holds_every_number_of_its_samples(rows):
    assert [row.row for row in rows] == list(range(5))
    assert all(len(row.samples) == CANDIDATES * 16 * 10 for row in rows)
    assert len({row.sha256 for row in rows}) == 5
    assert {row.nfe for row in rows} == {2}  # Euler with two steps, counted at the network


def test_the_files_alone_give_the_same_samples(rows, fleet, dataset, kit):
    again = reload_fixture(
        fleet[0] / "flow" / "seed_0", dataset, horizons=kit.HORIZONS, method="flow", seed=0, count=5
    )
    compared, mismatches = compare_fixtures(rows, again)
    assert mismatches == 0
    for row in compared:
        assert row.max_abs_difference == 0.0
        assert row.sha256_trained == row.sha256_reloaded


def test_one_changed_number_is_seen_with_its_size(rows):
    samples = list(rows[3].samples)
    samples[17] += 1e-9
    changed = [*rows[:3], replace(rows[3], samples=tuple(samples)), rows[4]]
    differences = [row.max_abs_difference for row in compare_fixtures(rows, changed)[0]]
    assert differences[3] == pytest.approx(1e-9, rel=1e-3)
    assert [d for n, d in enumerate(differences) if n != 3] == [0.0] * 4


@pytest.mark.parametrize("field", ["checkpoint", "sampler", "nfe", "prediction_horizon"])
def test_each_metadata_field_counts(rows, field):
    changed = [replace(row, **{field: "other"}) if row.row in (0, 2) else row for row in rows]
    assert compare_fixtures(rows, changed)[1] == 2


def test_a_number_that_is_none_is_no_equality(rows):
    samples = (float("nan"), *rows[1].samples[1:])
    changed = [rows[0], replace(rows[1], samples=samples), *rows[2:]]
    compared, _ = compare_fixtures(rows, changed)
    assert np.isnan(compared[1].max_abs_difference)


@pytest.mark.parametrize("damage", ["missing", "reordered", "extra"])
def test_other_rows_are_refused(rows, damage):
    changed = {"missing": rows[:-1], "reordered": rows[::-1], "extra": [*rows, rows[0]]}[damage]
    with pytest.raises(ContractError, match="the 5 rows written at training"):
        compare_fixtures(rows, changed)
