"""Modes that a brought policy is said to reach are asked of it again, in its own process."""

from dataclasses import replace

import pytest

from gates.rederive_measured import Bench, rederive_modes
from genpolicy.candidates.brought import read_brought
from genpolicy.candidates.wire.policy import running
from genpolicy.errors import RefusedError
from genpolicy.evidence.documents.conformance import CONFORMANCE
from genpolicy.evidence.need.held_out import modes_of_policy
from genpolicy.evidence.reproducibility.brought import UNSAID
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.integrity.rows import read_rows, write_rows
from tests.candidates.conftest import serving  # noqa: F401
from tests.gates.test_rederive_conformance import (  # noqa: F401
    PARAMS,
    judged,
    server,
    workspace,
)

SAMPLES = 3
MODES = "artifacts/reload/modes.parquet"


@pytest.fixture
def params(kit):
    return {**PARAMS, "feasibility": kit.PARAMS["feasibility"], "reload": {"samples": SAMPLES}}


@pytest.fixture
def measured(workspace, data, kit, params):  # noqa: F811
    """The evidence of one that was brought, with the modes that it reaches."""
    rows = [(uuid, 3, {}) for uuid in kit.uuids(data)[-3:]]
    kit.write_situations(workspace / "artifacts/audit", rows)
    bench = Bench.of("B", workspace, params)
    (brought,) = read_brought(params["candidates"], seed=0, root=workspace)
    declared = brought.entry.declared
    with running(brought, data.observation_contract) as wire:
        found = modes_of_policy(
            wire, bench.held_out(kit.HORIZONS.observation_horizon), seed=0,
            convention=declared.sampler if declared else UNSAID, samples=SAMPLES,
            task=bench.task, checker=bench.checker,
        )  # fmt: skip
    write_rows(workspace / MODES, ModeRow, found)
    write_rows(workspace / "artifacts/reload/modes_earlier.parquet", ModeRow, [])
    return workspace


def rewrite(root, **changes):
    rows = [replace(row, **changes) for row in read_rows(root / MODES, ModeRow)]
    write_rows(root / MODES, ModeRow, rows)


def test_true_rows_are_found_again(measured, params):
    rederive_modes(Bench.of("B", measured, params))


def test_a_count_that_it_does_not_give_is_refused(measured, params):
    rewrite(measured, admissible=SAMPLES, valid=SAMPLES, far_from_modes=0, between_modes=0)
    with pytest.raises(RefusedError, match=r"planted \(seed 0\)"):
        rederive_modes(Bench.of("B", measured, params))


def test_of_who_answers_otherwise_each_time_the_rows_are_asked_for_and_no_more(measured, params):
    judged(measured, "repeats", "fails")
    rewrite(measured, admissible=SAMPLES, valid=SAMPLES)
    rederive_modes(Bench.of("B", measured, params))
    write_rows(measured / MODES, ModeRow, [])
    with pytest.raises(RefusedError, match="no row"):
        rederive_modes(Bench.of("B", measured, params))


def test_without_a_document_of_its_answers_it_is_asked_all_the_same(measured, params):
    CONFORMANCE.write(measured / "artifacts/reload", {})
    rewrite(measured, samples=SAMPLES + 1)
    with pytest.raises(RefusedError, match="samples is 4"):
        rederive_modes(Bench.of("B", measured, params))
