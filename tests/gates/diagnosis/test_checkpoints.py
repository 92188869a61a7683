"""The nine checkpoint rows: each carried by criteria that exist, and owned by who limits them."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from test_walk import turned, without

from gates.diagnosis.checkpoints import CHECKPOINTS, NOT_JUDGED, ruled
from gates.diagnosis.reports import gate_and_id
from gates.proof import SPECS
from gates.settings import read_limits, read_params

ROOT = Path(__file__).parents[3]
CHAPTER = (
    ("need", "valid modes or recovery hypothesis", "multimodality audit",
     "hidden state or data defect explains it"),
    ("target", "mapped action and horizons", "action contract", "semantics differ by method"),
    ("model", "BC/ACT/diffusion/flow delta", "matched config matrix",
     "encoder, data, or resets unfair"),
    ("sampling", "schedule, solver, NFE, seed", "versioned sampler log",
     "only microbenchmark evidence"),
    ("timing", "full latency and action age", "trace and queue report",
     "p95 deadline/freshness violated"),
    ("feasibility", "representation→contact gates", "rejection/projection report",
     "invalid sample reaches stub"),
    ("recovery", "hold, retreat, fallback, human", "state-machine test",
     "resampling is the only recovery"),
    ("evidence", "source-specific conditions", "caveat ledger",
     "unmatched results create ranking"),
    ("safety", "independent supervisor", "reviewed trial card", "learned score owns safety"),
)  # fmt: skip
"""The table at the end of the chapter, by hand."""
EXISTING = {f"{gate}.{item.id}" for gate, spec in SPECS.items() for item in spec.criteria}


def row(reports, area):
    return next(one for one in ruled(reports) if one.area == area)


def test_the_rows_are_the_chapters_in_its_order():
    rows = tuple((c.area, c.decision, c.artifact, c.reject_when) for c in CHECKPOINTS)
    assert rows == CHAPTER


def test_every_row_names_criteria_that_exist_each_once():
    for checkpoint in CHECKPOINTS:
        assert checkpoint.criteria
        assert set(checkpoint.criteria) <= EXISTING, checkpoint.area
        assert max(Counter(checkpoint.criteria).values()) == 1


def test_every_criterion_of_every_gate_carries_a_row():
    assert {name for checkpoint in CHECKPOINTS for name in checkpoint.criteria} == EXISTING


@pytest.mark.parametrize("checkpoint", CHECKPOINTS, ids=lambda one: one.area)
def test_who_owns_a_row_owns_most_of_its_limits_or_as_many_as_anybody(checkpoint):
    params = read_params(ROOT)
    limits = {g: read_limits(params, g, SPECS[g].criteria).of for g in SPECS}
    named = [gate_and_id(name) for name in checkpoint.criteria]
    owners = Counter(limits[gate][name].owner for gate, name in named if name in limits[gate])
    assert owners[checkpoint.owner] > 0


def test_what_is_judged_stands_and_the_card_waits(honest):
    rows = {one.area: one.verdict for one in ruled(honest)}
    assert rows == {**dict.fromkeys(rows, "PASS"), "safety": NOT_JUDGED}
    assert "gate_e" in row(honest, "safety").waits_for[0]
    assert row(honest, "timing").candidates == {"diffusion": "PASS", "flow": "PASS"}


def test_a_row_falls_with_its_criterion_and_names_it(honest):
    found = row(turned(honest, "A.data_defects", "FAIL"), "need")
    assert found.verdict == "FAIL" and found.unmet == ("A.data_defects FAIL",)
    assert found.owner == "perception"


def test_one_candidate_that_holds_in_all_is_enough_and_the_other_is_named(honest):
    one = turned(honest, "C.admissible_share", "FAIL", "diffusion")
    assert row(one, "feasibility").verdict == "PASS"
    assert row(one, "feasibility").unmet == ("C.admissible_share (diffusion) FAIL",)
    both = turned(one, "D.stub_violations", "FAIL", "flow")
    assert row(both, "feasibility").verdict == "FAIL"


def test_who_was_stopped_below_does_not_pass_by_what_was_never_asked(honest):
    """Diffusion failed at C and is not in D; of sampling it has B's answers only."""
    report = honest.judged["D"]
    criteria = tuple(c for c in report.criteria if c.candidate != "diffusion")
    stopped = report.model_copy(update={"criteria": criteria, "candidates": {"flow": "FAIL"}})
    reports = replace(honest, judged={**honest.judged, "D": stopped})
    found = row(turned(reports, "D.nominal_success_lower", "FAIL", "flow"), "sampling")
    assert found.verdict == "FAIL" and found.candidates == {"flow": "FAIL"}


def test_what_is_broken_is_said_although_a_gate_waits(honest):
    reports = turned(without(honest, "D"), "C.incidents_miscounted", "FAIL", "flow")
    found = row(turned(reports, "C.incidents_miscounted", "FAIL", "diffusion"), "recovery")
    assert found.verdict == "FAIL" and found.waits_for == ("no D",)
    assert row(without(honest, "D"), "recovery").verdict == NOT_JUDGED
    open_one = turned(without(honest, "B"), "A.baselines_matched", "INCONCLUSIVE")
    assert row(open_one, "target").verdict == "INCONCLUSIVE"
