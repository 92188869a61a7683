"""The sweep: what samplers draw, what they take, and that both name the same settings."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.judged import trained
from genpolicy.candidates.wire.entry import ServerEntry
from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.evidence.reproducibility import sweep
from genpolicy.evidence.reproducibility.latency import LatencyPlan
from genpolicy.evidence.reproducibility.sweep import (
    Quality,
    coverage_row,
    jerk_p95_m_s3,
    measure_sweep,
    quality_of,
    swept_windows,
)
from genpolicy.evidence.reproducibility.swept import beside_steps, swept_samplers
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.policies.fixtures import fixture_observations
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.settings import SamplerConfig
from tests.candidates.conftest import ENTRY

PERIOD_S = 0.05


def test_jerk_is_the_third_difference_over_the_period():
    """Golden: x = t^3 has the jerk 6 wherever it is asked; two chunks of another scale."""
    t = PERIOD_S * np.arange(8)
    path = np.zeros((2, 8, 3))
    path[0, :, 1], path[1, :, 2] = t**3, 2.5 * t**3
    assert jerk_p95_m_s3(path[:1], period_s=PERIOD_S) == pytest.approx(6.0)
    assert jerk_p95_m_s3(path, period_s=PERIOD_S) == pytest.approx(15.0)
    assert jerk_p95_m_s3(path[:, :3], period_s=PERIOD_S) == 0.0
    straight = path + t[:, None] * 7.0 + 3.0
    assert jerk_p95_m_s3(straight, period_s=PERIOD_S) == pytest.approx(15.0)


class Said:
    """A policy that answers with what it was given."""

    prediction_horizon = 16

    def __init__(self, policy, chunks):
        self.horizons, self._policy, self._chunks = policy.horizons, policy, chunks

    def sample(self, observations, *, noise_names, candidates):
        drawn = self._policy.sample(observations, noise_names=noise_names, candidates=candidates)
        return replace(drawn, actions=self._chunks[:, None])


def test_who_says_the_demonstrated_chunk_makes_no_error_and_padding_counts_for_nothing(
    policy, data, kit
):
    windows = swept_windows(data, kit.HORIZONS)
    count = len(windows.observations)
    assert 0 < count <= sweep.WINDOWS and windows.is_pad.any()
    assert quality_of(Said(policy, windows.actions), windows, data).chunk_error == 0.0
    spoiled = windows.actions + 9.0 * windows.is_pad[..., None]
    assert quality_of(Said(policy, spoiled), windows, data).chunk_error == 0.0
    moved = windows.actions.copy()
    moved[..., 0] += 0.01
    found = quality_of(Said(policy, moved), windows, data)
    assert found.chunk_error > 0.0
    drawn = quality_of(policy, windows, data)
    assert drawn == quality_of(policy, windows, data) and drawn.jerk_p95_m_s3 > 0.0


def test_a_tolerance_belongs_to_solvers_that_choose_their_steps():
    mode = ModeRow(
        method="flow", seed=0, convention="euler", episode_uuid="e", index=1, samples=4,
        modes_present=2, modes_covered=2, between_modes=0, far_from_modes=0, admissible=4, valid=4,
        modes_valid=2, fewest_admissible=1, nfe=4, spread_m=0.1,
    )  # fmt: skip
    quality = Quality(0.25, 7.0, 0)
    euler = SamplerConfig(name="euler", steps=4)
    row = coverage_row([mode], sampler=euler, quality=quality)
    assert (row.tolerance, row.sampler_sha256, row.steps) == (None, euler.hash(), 4)
    assert (row.chunk_error, row.jerk_p95_m_s3, row.modes_covered_share) == (0.25, 7.0, 1.0)
    bosh3 = SamplerConfig(name="bosh3", steps=4, tolerance=0.01, nfe_cap=99)
    assert coverage_row([mode], sampler=bosh3, quality=quality).tolerance == 0.01


def test_what_a_setting_is_besides_its_steps_is_said_where_it_is_not_as_by_default():
    said = {
        "": SamplerConfig(name="ddim", steps=16),
        "eta 1": SamplerConfig(name="ddim", steps=16, eta=1.0),
        "clip none": SamplerConfig(name="ddim", steps=16, clip=None),
        "clip 2, eta 0.5": SamplerConfig(name="ddim", steps=16, clip=2.0, eta=0.5),
        "population 64": SamplerConfig(name="langevin", steps=4, population=64),
        "nfe_cap 99": SamplerConfig(name="bosh3", steps=4, tolerance=0.01, nfe_cap=99),
    }
    assert {text: beside_steps(sampler) for text, sampler in said.items()} == {
        text: text for text in said
    }


def test_every_swept_setting_is_timed_under_the_name_that_its_samples_have(
    fleet, dataset, kit, monkeypatch
):
    monkeypatch.setattr(sweep, "REPEATS", 2)
    monkeypatch.setattr(sweep, "in_fresh_process", lambda work, *a, **k: work(*a, **k))
    plan = LatencyPlan(
        dataset=dataset, task="tabletop_insertion", feasibility=kit.FEASIBILITY,
        horizons=kit.HORIZONS, samples=4, warm=2, cold=2,
    )  # fmt: skip
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    tried = [1, SamplerConfig(name="midpoint")]
    rows = sweep.sweep_latency_rows(plan, [flow], {"flow": tried})
    assert rows and [row.repeat for row in rows] == [0, 0, 0, 1, 1, 1]
    loaded = flow.load()
    hashes = [
        NetworkPolicy(loaded.checkpoint, sampler=sampler).sampler_config_hash
        for sampler in swept_samplers(loaded.sampler, tried)
    ]
    assert [row.sampler_sha256 for row in rows] == hashes * 2 and len(set(hashes)) == 3
    assert all(row.seconds > 0 and row.candidates == 4 for row in rows)
    capped = SamplerConfig(name="bosh3", steps=4, tolerance=1e-9, nfe_cap=10)
    rows = sweep.sweep_latency_rows(plan, [flow], {"flow": [capped]})
    assert {row.sampler_sha256 for row in rows} == {loaded.sampler_config_hash}, "gave no answer"
    alone = measure_sweep(plan, flow, ())
    assert {row.sampler_sha256 for row in alone} == {loaded.sampler_config_hash}


@pytest.mark.parametrize("number", [np.inf, np.nan])
def test_a_chunk_that_is_no_numbers_marks_its_setting_and_ends_nothing(policy, data, kit, number):
    windows = swept_windows(data, kit.HORIZONS)
    spoiled = windows.actions.copy()
    spoiled[:2, 5, 0] = number
    found = quality_of(Said(policy, spoiled), windows, data)
    assert found.nonfinite == 2 and np.isnan([found.chunk_error, found.jerk_p95_m_s3]).all()


def test_a_setting_that_answers_nothing_has_no_times(dataset, data, kit, policy, tmp_path):
    """Wrong before: its faults, of microseconds each, stood on the front as the fastest answers."""
    plan = LatencyPlan(
        dataset=dataset, task="tabletop_insertion", feasibility=kit.FEASIBILITY,
        horizons=kit.HORIZONS, samples=2, warm=2, cold=2,
    )  # fmt: skip
    entry = ServerEntry.model_validate(ENTRY)
    brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
    absent = WirePolicy(brought, PolicyError(Fault.REFUSED, "no"))
    seen = fixture_observations(data, horizons=kit.HORIZONS, count=2)
    rows = sweep._in_turns(plan, "planted", [policy, absent], seen)
    assert {row.sampler_sha256 for row in rows} == {policy.sampler_config_hash}
    assert len(rows) == sweep.REPEATS
