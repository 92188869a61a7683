"""What a latent changes: dependent on the observation, the same everywhere, or noise."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from genpolicy.errors import ContractError
from genpolicy.evidence.documents.need import LATENT
from genpolicy.evidence.need.baselines import (
    BaselinePlan,
    LatentTest,
    latent_rows,
    mode_rows,
    require_repeatable,
)
from genpolicy.evidence.need.held_out import held_out_situations
from genpolicy.evidence.need.latent import dependence, latent_dependence
from genpolicy.integrity.documents import canonical_json
from genpolicy.statistics.intervals import clopper_pearson

LATENTS, STEPS = 8, 4


def paths_of(kind, observations, seed=0):
    """Chunks of shared latents: a mean that follows the observation, and a change of some kind."""
    rng = np.random.default_rng(seed)
    count = len(observations)
    latent = rng.normal(size=(1, LATENTS, 1, 1))
    mean = observations[:, None, None, :3] * np.ones((1, 1, STEPS, 1))
    if kind == "task":
        change = 0.05 * latent * observations[:, None, None, :3]
    elif kind == "style":
        change = 0.05 * latent * np.ones((count, 1, STEPS, 3))
    else:
        change = 0.05 * rng.normal(size=(count, LATENTS, STEPS, 3))
    return mean + change


def held(kind, seed=0, count=60, permutations=199):
    rng = np.random.default_rng(1000 + seed)
    observations = rng.normal(size=(count, 5))
    return dependence(
        observations, paths_of(kind, observations, seed), permutations=permutations,
        rng=np.random.default_rng(seed),
    )  # fmt: skip


def test_a_change_that_follows_the_observation_is_found():
    found = held("task")
    assert found.exceeding == 0
    assert found.distance_correlation > 0.5
    assert found.condition_share > 0.5


def test_the_same_change_everywhere_is_style():
    found = held("style")
    assert found.exceeding == found.permutations
    assert found.condition_share < 1e-12
    assert found.distance_correlation == 0.0
    assert found.spread_m > 0.03


def test_noise_is_called_a_dependence_at_the_level_of_the_test_only():
    """False positives by simulation: at 5 per cent, 200 draws, the exact 99.9 % band."""
    wrong = sum(
        (found.exceeding + 1) / (found.permutations + 1) <= 0.05
        for found in (held("noise", seed, count=20, permutations=99) for seed in range(200))
    )
    assert wrong <= 22


def test_a_latent_without_any_effect_is_no_dependence():
    observations = np.random.default_rng(0).normal(size=(20, 3))
    paths = np.repeat(observations[:, None, None, :], LATENTS, axis=1)
    found = dependence(observations, paths, permutations=9, rng=np.random.default_rng(0))
    assert found.spread_m < 1e-9
    assert found.exceeding == found.permutations


def test_the_unit_of_the_change_is_metres_and_nothing_else_depends_on_it():
    observations = np.random.default_rng(0).normal(size=(30, 5))
    paths = paths_of("task", observations)
    one, ten = (
        dependence(observations, f * paths, permutations=49, rng=np.random.default_rng(0))
        for f in (1.0, 10.0)
    )
    assert ten.spread_m == pytest.approx(10 * one.spread_m)
    assert ten.distance_correlation == pytest.approx(one.distance_correlation)
    assert ten.exceeding == one.exceeding


def test_the_interval_of_the_permutations_holds_the_p_of_all_of_them():
    """A test with few permutations is an estimate of the one with many: 19 of 20 intervals hold."""
    rng = np.random.default_rng(4)
    observations = rng.normal(size=(25, 5))
    paths = paths_of("noise", observations) + 0.4 * paths_of("task", observations)

    def tested(permutations, seed):
        generator = np.random.default_rng(seed)
        found = dependence(observations, paths, permutations=permutations, rng=generator)
        return clopper_pearson(found.exceeding, permutations), found.exceeding / permutations

    truth = tested(20_000, 1)[1]
    assert 0.005 < truth < 0.995, "neither end, or the interval is not asked"
    held = sum(lower <= truth <= upper for (lower, upper), _ in (tested(99, s) for s in range(100)))
    assert held >= 90


def test_the_shipped_number_of_permutations_tells_p_at_the_limit_to_a_tenth():
    """999 left .034 to .061 about a p of .046: which side of .05 it fell was luck."""
    params = yaml.safe_load((Path(__file__).parents[3] / "params.yaml").read_text())
    count = params["measure_baselines"]["latent"]["permutations"]
    limit = params["gate_a"]["limits"]["model"]["latent_dependence_p"][0]
    lower, upper = clopper_pearson(round(limit * count), count)
    assert (upper - lower) / 2 <= 0.1 * limit


def test_a_trained_policy_is_asked_with_shared_latents(data, kit, tmp_path, policy):
    names = kit.uuids(data)
    audit = kit.write_situations(tmp_path / "audit", [(names[i], 4, {}) for i in range(6)])
    found = held_out_situations(audit, data, horizons=kit.HORIZONS)
    one, two = (
        latent_dependence(policy, found, samples=4, permutations=19, root_seed=5) for _ in range(2)
    )
    assert one == two
    assert one.situations == 6 and one.spread_m > 0.0


def test_a_tested_latent_is_a_row_of_its_document(dataset, data, kit, tmp_path, policy):
    names = kit.uuids(data)
    audit = kit.write_situations(tmp_path / "audit", [(names[i], 4, {}) for i in range(6)])
    test = LatentTest(method="flow", convention="drawn", permutations=19)
    plan = BaselinePlan(
        task="tabletop_insertion", dataset=dataset, audit=audit, horizons=kit.HORIZONS,
        feasibility=kit.FEASIBILITY, conventions={"flow": {"drawn": policy.sampler}}, samples=4,
        latent=test, root_seed=5,
    )  # fmt: skip
    held = held_out_situations(audit, data, horizons=kit.HORIZONS)
    rows = latent_rows(plan, policy, held, seed=3)
    LATENT.write(tmp_path, rows)
    assert LATENT.read(tmp_path) == rows
    (row,) = rows
    assert (row.method, row.convention, row.seed, row.permutations) == ("flow", "drawn", 3, 19)
    assert (tmp_path / "latent.json").read_bytes() == canonical_json([vars(row)])
    other = plan.__class__(**{**vars(plan), "latent": None})
    assert latent_rows(other, policy, held, seed=3) == []


def test_a_policy_whose_noise_has_no_key_is_refused_before_anything_is_counted(
    data, kit, dataset, tmp_path, policy, monkeypatch
):
    names = kit.uuids(data)
    audit = kit.write_situations(tmp_path / "audit", [(names[i], 4, {}) for i in range(6)])
    plan = BaselinePlan(
        task="tabletop_insertion", dataset=dataset, audit=audit, horizons=kit.HORIZONS,
        feasibility=kit.FEASIBILITY, conventions={}, samples=2, latent=None, root_seed=5,
    )  # fmt: skip
    held = held_out_situations(audit, data, horizons=kit.HORIZONS)
    assert mode_rows(plan, policy, held, seed=0), "with its key it is counted"
    fresh = np.random.default_rng(0)
    drawn = "genpolicy.policies.policy.counter_noise"
    monkeypatch.setattr(drawn, lambda names, *, shape: fresh.standard_normal(shape))
    with pytest.raises(ContractError, match=r"drawn again under the same key, by up to 0\.\d"):
        mode_rows(plan, policy, held, seed=0)
    nothing = replace(held, situations=[], observations=held.observations[:0])
    require_repeatable(policy, nothing, "drawn")
