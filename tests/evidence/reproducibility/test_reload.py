"""Reload and sweep of a barely trained candidate: equal samples, modes counted once."""

import math
from dataclasses import replace

import pytest

from gates.reproducibility.identity import unrecorded
from genpolicy.candidates.judged import trained
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import ContractError, EvaluationCapError
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.evidence.reproducibility import fixtures, reload
from genpolicy.evidence.reproducibility.identity import Deployment
from genpolicy.evidence.reproducibility.reload import ReloadPlan, write_reload
from genpolicy.evidence.reproducibility.sweep import Quality, coverage_row, swept_windows
from genpolicy.evidence.rows.need import ModeRow, OfflineRow
from genpolicy.evidence.rows.reproducibility import (
    PARTS,
    UPDATE,
    VARIATIONS,
    ComputeRow,
    CoverageRow,
    DensityRow,
    NfeRow,
    SampleRow,
    VariationRow,
)
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.policies import methods
from genpolicy.policies.fixtures import FixtureRow, fixture_observations, fixture_rows
from genpolicy.policies.settings import SamplerConfig


@pytest.fixture(scope="module")
def reloaded(fleet, dataset, data, policy, kit, tmp_path_factory):
    root = tmp_path_factory.mktemp("reload")
    situations = [(name, 4, {}) for name in kit.uuids(data)[8:]]
    plan = ReloadPlan(
        task="tabletop_insertion", feasibility=kit.FEASIBILITY, dataset=dataset,
        audit=kit.write_situations(root / "audit", situations), samples=3,
        deployment=Deployment(
            kit.HORIZONS, deadline_s=0.15, samples=4, replan_lead_rows=3
        ),
        root_seed=3,
        sweep={"flow": [1, 2, SamplerConfig(name="midpoint"), SamplerConfig(name="euler")]},
    )  # fmt: skip
    seen = fixture_observations(data, horizons=kit.HORIZONS, count=3)
    rows = fixture_rows(policy, seen, method="flow", seed=0)
    write_rows(root / "fixtures.parquet", FixtureRow, rows)
    (root / "out").mkdir()
    candidates = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    write_reload(plan, candidates, root / "fixtures.parquet", root / "out")
    return plan, candidates, root / "out"


def test_what_comes_back_is_equal_and_pinned(reloaded):
    _, (flow,), folder = reloaded
    samples = read_rows(folder / "samples.parquet", SampleRow)
    assert len(samples) == 3 and {row.max_abs_difference for row in samples} == {0.0}
    assert read_rows(folder / "nfe.parquet", NfeRow) == [NfeRow("flow", 0, 2, 2, 2, 2, 2)]
    varied = read_rows(folder / "variations.parquet", VariationRow)
    assert {(row.variation, row.unequal, row.max_abs_difference) for row in varied} == {
        (way, 0, 0.0) for way in VARIATIONS
    }
    compute = read_rows(folder / "compute.parquet", ComputeRow)
    assert [(row.method, row.part) for row in compute] == [
        ("flow", part) for part in (*PARTS, UPDATE)
    ]
    identity = CANDIDATES.read(folder)["flow"]
    assert identity.checkpoint == flow.sha256 and identity.checkpoints == [flow.sha256]
    assert identity.metadata_mismatches == identity.nonfinite_weights == 0


def test_modes_of_the_chosen_steps_are_those_of_the_sweep(reloaded):
    _, _, folder = reloaded
    modes = read_rows(folder / "modes.parquet", ModeRow)
    coverage = read_rows(folder / "coverage.parquet", CoverageRow)
    swept = [(row.sampler, row.steps, row.nfe) for row in coverage]
    assert swept == [("euler", 1, 1), ("euler", 2, 2), ("midpoint", 1, 2)]
    assert {row.convention for row in modes} == {"euler"} and len(modes) == 2
    quality = Quality(coverage[1].chunk_error, coverage[1].jerk_p95_m_s3, 0)
    own = SamplerConfig(name="euler", steps=2)
    assert coverage_row(modes, sampler=own, quality=quality) == coverage[1]
    assert all(row.chunk_error > 0 and row.jerk_p95_m_s3 > 0 for row in coverage)
    assert len({row.sampler_sha256 for row in coverage}) == 3
    earlier = read_rows(folder / "modes_earlier.parquet", ModeRow)
    drawn = [
        [(r.episode_uuid, r.index, r.samples, r.nfe) for r in rows] for rows in (modes, earlier)
    ]
    assert drawn[0] == drawn[1] and modes != earlier
    assert {row.split for row in read_rows(folder / "offline.parquet", OfflineRow)} == {
        "validation", "test",
    }  # fmt: skip


def test_every_mode_of_a_situation_has_a_density_and_its_share(reloaded):
    _, _, folder = reloaded
    rows = read_rows(folder / "density.parquet", DensityRow)
    modes = read_rows(folder / "modes.parquet", ModeRow)
    asked = [(row.episode_uuid, row.index, row.mode) for row in rows]
    assert asked == [(m.episode_uuid, m.index, n) for m in modes for n in range(m.modes_present)]
    assert {(row.method, row.seed, row.samples) for row in rows} == {("flow", 0, 3)}
    for drawn in modes:
        own = [r.reached for r in rows if r.episode_uuid == drawn.episode_uuid]
        assert sum(own) == drawn.samples - drawn.between_modes - drawn.far_from_modes


def test_a_solver_that_evaluates_once_too_often_is_not_what_it_says(
    reloaded, data, policy, kit, tmp_path, monkeypatch
):
    """It agrees with itself, at training and after reload; its definition says otherwise."""
    honest = methods.sample_ode

    def wasteful(velocity, noise, **settings):
        velocity(noise(0), noise(0).new_zeros(len(noise(0))))
        return honest(velocity, noise, **settings)

    monkeypatch.setattr(methods, "sample_ode", wasteful)
    for module in (fixtures, reload):
        monkeypatch.setattr(module, "in_fresh_process", lambda work, *a, **k: work(*a, **k))
    seen = fixture_observations(data, horizons=kit.HORIZONS, count=3)
    rows = fixture_rows(policy, seen, method="flow", seed=0)
    write_rows(tmp_path / "fixtures.parquet", FixtureRow, rows)
    plan, candidates, _ = reloaded
    write_reload(plan, candidates, tmp_path / "fixtures.parquet", tmp_path)
    assert read_rows(tmp_path / "nfe.parquet", NfeRow) == [NfeRow("flow", 0, 3, 3, 2, 2, 2)]


@pytest.mark.parametrize("swept", [True, False])
def test_a_sampler_that_reaches_its_cap_marks_its_candidate_and_ends_nothing(
    reloaded, tmp_path, monkeypatch, swept
):
    """As a setting of the sweep, and as the candidate's own, whose fixtures were drawn in time.

    Wrong before: the whole stage ended with exit 2, for every candidate.
    """
    plan, candidates, folder = reloaded
    capped = SamplerConfig(name="bosh3", steps=4, tolerance=1e-9, nfe_cap=10)
    monkeypatch.setattr(reload, "in_fresh_process", lambda work, *a, **k: work(*a, **k))
    honest = methods.sample_ode

    def hard(velocity, noise, **settings):
        drawn = honest(velocity, noise, **settings)
        if settings["steps"] == 2 and bool((drawn[:, 0, 0] > 0.0).any()):
            raise EvaluationCapError(where="a", found="b", expected="c", action="d")
        return drawn

    if not swept:
        monkeypatch.setattr(methods, "sample_ode", hard)
    plan = replace(plan, sweep={"flow": [capped]} if swept else {})
    write_reload(plan, candidates, folder.parent / "fixtures.parquet", tmp_path)
    rows = {row.sampler: row for row in read_rows(tmp_path / "coverage.parquet", CoverageRow)}
    assert set(rows) == ({"bosh3", "euler"} if swept else {"euler"})
    given_up = rows["bosh3" if swept else "euler"]
    assert given_up.given_up == given_up.nonfinite > 0 and math.isnan(given_up.chunk_error)
    own = CANDIDATES.read(tmp_path)["flow"]
    assert own.nonfinite_chunks == own.given_up == (0 if swept else given_up.given_up)
    if swept:
        assert given_up.admissible_share == given_up.modes_covered_share == 0.0
        assert given_up.nfe <= 10 and given_up.settings == "nfe_cap 10"
        assert rows["euler"].given_up == 0 and rows["euler"].chunk_error > 0.0
    else:
        offline = read_rows(tmp_path / "offline.parquet", OfflineRow)
        assert any(math.isnan(row.masked_mae) for row in offline)
        assert (
            0
            < given_up.given_up
            < len(swept_windows(load_dataset(plan.dataset), plan.horizons).observations)
        )


def test_the_card_says_what_runs(reloaded, data):
    _, (flow,), folder = reloaded
    card, config = CANDIDATES.read(folder)["flow"].card, flow.load().checkpoint.config
    assert (card.sampler, card.sampler_steps, card.evaluations) == ("euler", 2, "2")
    assert (card.eta, card.tolerance) == (None, None) and card.path.startswith("straight path")
    assert (card.control_rate_hz, card.invocation_rate_hz) == pytest.approx((20.0, 4.0))
    assert (card.candidates, card.selector, card.deadline_s) == (4, "first_admissible", 0.15)
    assert card.dataset == data.manifest_sha256 and card.precision == "float32"
    assert card.parameters == config.parameters["total"] > 0 and card.threads == 1
    assert unrecorded(card) == []


def test_a_candidate_without_fixtures_is_refused(reloaded, tmp_path):
    plan, candidates, _ = reloaded
    write_rows(tmp_path / "fixtures.parquet", FixtureRow, [])
    with pytest.raises(ContractError, match="fixtures of flow, seed 0 is none"):
        write_reload(plan, candidates, tmp_path / "fixtures.parquet", tmp_path)


@pytest.mark.parametrize("steps", [1, 2])
def test_weights_that_give_no_numbers_under_a_sampler_are_rows_and_end_nothing(
    reloaded, tmp_path, monkeypatch, steps
):
    """By one step it is a setting of the sweep that diverges, by two the candidate itself."""
    plan, candidates, folder = reloaded
    honest = methods.sample_ode

    def diverging(velocity, noise, *, name, steps: int, skipped: int):
        drawn = honest(velocity, noise, name=name, steps=steps, skipped=skipped).clone()
        if (name, steps) == ("euler", diverged):
            drawn[drawn[:, 0, 0] > 0.0] = float("inf")
        return drawn

    diverged = steps
    monkeypatch.setattr(reload, "in_fresh_process", lambda work, *a, **k: work(*a, **k))
    monkeypatch.setattr(methods, "sample_ode", diverging)
    write_reload(plan, candidates, folder.parent / "fixtures.parquet", tmp_path)
    found = {row.steps: row for row in read_rows(tmp_path / "coverage.parquet", CoverageRow)
             if row.sampler == "euler"}  # fmt: skip
    assert found[steps].nonfinite > 0 and math.isnan(found[steps].chunk_error)
    assert found[3 - steps].nonfinite == 0 and found[3 - steps].chunk_error > 0.0
    own = CANDIDATES.read(tmp_path)["flow"]
    assert (own.nonfinite_weights, own.nonfinite_chunks) == (0, found[2].nonfinite)
    offline = read_rows(tmp_path / "offline.parquet", OfflineRow)
    assert any(math.isnan(row.masked_mae) for row in offline) == (steps == 2)
