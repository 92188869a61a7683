"""Fixtures that a checkpoint does not draw, or draws otherwise than is said, are refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from gates.rederive_fixtures import ROUNDED, rederive_fixtures
from gates.rederive_measured import Bench
from genpolicy.contract.chunk import actions_sha256
from genpolicy.errors import RefusedError
from genpolicy.evidence.reproducibility.variations import of_threads
from genpolicy.evidence.rows.reproducibility import FIXTURES_ON, SampleRow, VariationRow
from genpolicy.integrity.rows import write_rows
from genpolicy.policies.fixtures import FixtureRow, fixture_observations, fixture_rows
from genpolicy.policies.policy import NetworkPolicy

COUNT = 3


@pytest.fixture(scope="module")
def true(policy, data, kit):
    """The three tables as they are of the flow, trained for an instant."""
    seen = fixture_observations(data, horizons=kit.HORIZONS, count=COUNT)
    drawn = fixture_rows(policy, seen, method="flow", seed=0)
    samples = [
        SampleRow("flow", 0, FIXTURES_ON, row.row, row.sha256, row.sha256, 0.0) for row in drawn
    ]
    varied = of_threads(policy, seen).rows("flow", seed=0, device=FIXTURES_ON)
    return SimpleNamespace(drawn=drawn, samples=samples, varied=varied)


@pytest.fixture
def holds(tmp_path, fleet, dataset, kit, true):
    """Holds three tables against the checkpoint."""
    artifacts = tmp_path / "artifacts"
    (artifacts / "reload").mkdir(parents=True)
    (artifacts / "train_generators").mkdir()
    (artifacts / "train_generators/flow").symlink_to(fleet[0] / "flow")
    (artifacts / "ingest").symlink_to(dataset)
    params = {
        **{name: kit.PARAMS[name] for name in ("horizons", "feasibility", "task", "compute")},
        "policy": {"fixtures": COUNT, "seeds": [0]},
        "train_generators": {"samplers": {"flow": kit.SAMPLERS["flow"].model_dump()}},
    }

    def holds(drawn=true.drawn, samples=true.samples, varied=true.varied):
        write_rows(artifacts / "train_generators/fixtures.parquet", FixtureRow, drawn)
        write_rows(artifacts / "reload/samples.parquet", SampleRow, samples)
        write_rows(artifacts / "reload/variations.parquet", VariationRow, varied)
        rederive_fixtures(Bench.of("B", tmp_path, params))

    return holds


def changed(rows, at, **changes):
    return [replace(row, **changes) if n == at else row for n, row in enumerate(rows)]


def test_true_tables_are_found_again_and_the_caller_keeps_its_threads(holds):
    before = torch.get_num_threads()
    holds()
    assert torch.get_num_threads() == before


def test_rows_of_another_device_are_no_matter_of_this(holds, true):
    holds(samples=[*true.samples, replace(true.samples[0], device="cuda", max_abs_difference=9.0)])


@pytest.mark.parametrize("name", ["checkpoint", "sampler"])
def test_fixtures_of_another_checkpoint_are_refused(holds, true, name):
    with pytest.raises(RefusedError, match=rf"flow \(seed 0\), fixture 1: {name}"):
        holds(drawn=changed(true.drawn, 1, **{name: "0" * 64}))


@pytest.mark.parametrize("name", ["nfe", "prediction_horizon"])
def test_counts_that_the_checkpoint_does_not_have_are_refused(holds, true, name):
    row = true.drawn[2]
    with pytest.raises(RefusedError, match=rf"fixture 2: {name} is {getattr(row, name) + 1}"):
        holds(drawn=changed(true.drawn, 2, **{name: getattr(row, name) + 1}))


def test_samples_that_the_checkpoint_does_not_draw_are_refused(holds, true):
    """With a hash that is theirs, in both tables: a table that agrees with itself."""
    other = true.drawn[1]
    drawn = changed(true.drawn, 0, samples=other.samples, sha256=other.sha256)
    samples = changed(true.samples, 0, sha256_trained=other.sha256, sha256_reloaded=other.sha256)
    with pytest.raises(RefusedError, match=r"fixture 0: max_abs_difference is 0"):
        holds(drawn=drawn, samples=samples)


def test_a_difference_that_is_stated_as_it_is_found_is_honest(holds, true):
    """A policy that does not come back fails at its gate, and its evidence is true."""
    moved = tuple(value + 0.5 for value in true.drawn[0].samples)
    digest = _digest(true.drawn[0], moved)
    drawn = changed(true.drawn, 0, samples=moved, sha256=digest)
    told = {"sha256_trained": digest, "max_abs_difference": 0.5}
    holds(drawn=drawn, samples=changed(true.samples, 0, **told))
    with pytest.raises(RefusedError, match=r"max_abs_difference is 0\.4"):
        told["max_abs_difference"] = 0.4
        holds(drawn=drawn, samples=changed(true.samples, 0, **told))


def _digest(row, samples):
    return actions_sha256(np.asarray(samples).reshape(2, row.prediction_horizon, -1))


def test_a_hash_of_other_numbers_is_refused(holds, true):
    with pytest.raises(RefusedError, match=r"fixture 0: sha256 is [0-9a-f]{12}.*numbers beside"):
        holds(drawn=changed(true.drawn, 0, sha256=true.drawn[1].sha256))
    with pytest.raises(RefusedError, match="fixture 0: sha256 "):
        holds(drawn=changed(true.drawn, 0, samples=true.drawn[0].samples[:-1]))
    with pytest.raises(RefusedError, match="fixture 2: sha256_trained"):
        holds(samples=changed(true.samples, 2, sha256_trained="f" * 64))


def test_the_same_bits_do_not_differ(holds, true):
    with pytest.raises(RefusedError, match=r"fixture 1: max_abs_difference is 1e-06.*same bits"):
        holds(samples=changed(true.samples, 1, max_abs_difference=1e-6))


@pytest.mark.parametrize("table", ["drawn", "samples", "varied"])
@pytest.mark.parametrize("how", [lambda rows: rows[1:], lambda rows: [*rows, rows[-1]],
                                 lambda rows: []])  # fmt: skip
def test_each_fixture_and_each_way_stands_once(holds, true, table, how):
    with pytest.raises(RefusedError, match=r"flow \(seed 0\)"):
        holds(**{table: how(getattr(true, table))})


def test_a_way_that_changes_more_than_is_said_is_refused(holds, true, monkeypatch):
    """Numbers that hang on the company: as the table has it, they do not."""
    draw = NetworkPolicy.sample

    def alone(policy, observations, **named):
        drawn = draw(policy, observations, **named)
        if len(observations) == 1:
            drawn = replace(drawn, actions=drawn.actions + 0.01)
        return drawn

    monkeypatch.setattr(NetworkPolicy, "sample", alone)
    with pytest.raises(RefusedError, match=r"flow \(seed 0\), alone: .* is differs by"):
        holds()
    honest = [
        replace(row, max_abs_difference=0.01 + ROUNDED) if row.variation == "alone" else row
        for row in true.varied
    ]
    holds(varied=honest)


@pytest.mark.parametrize("changes", [{"unknown": "it was not to be had"}, {"chunks": 1},
                                     {"max_abs_difference": None},
                                     {"max_abs_difference": float("nan")}])  # fmt: skip
def test_a_way_that_can_be_asked_was(holds, true, changes):
    with pytest.raises(RefusedError, match=r"flow \(seed 0\), threads"):
        holds(varied=changed(true.varied, 0, **changes))


def test_samples_that_are_no_numbers_now_are_refused(holds, monkeypatch):
    draw = NetworkPolicy.sample

    def nothing(policy, observations, **named):
        drawn = draw(policy, observations, **named)
        return replace(drawn, actions=drawn.actions * float("nan"))

    monkeypatch.setattr(NetworkPolicy, "sample", nothing)
    with pytest.raises(RefusedError, match=r"flow \(seed 0\): fixtures"):
        holds()
