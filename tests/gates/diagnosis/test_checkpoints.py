"""The nine checkpoint rows: each carried by criteria that exist, and owned by who limits them."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import evidence
import pytest
from test_walk import turned, without

from gates.diagnosis.checkpoints import CHECKPOINTS, NOT_JUDGED, UNMATCHED, ruled
from gates.diagnosis.printed import checkpoints_text, walk_text
from gates.diagnosis.reports import Reports, gate_and_id
from gates.diagnosis.walk import Walk, walk
from gates.evidence import Evidence
from gates.proof import SPECS, judge
from gates.report import read_report
from gates.reproducibility.settings import MATCHING
from gates.settings import read_limits, read_params
from tests.gates.reproducibility.test_brought import EXCEPTION, bring

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
    assert owners[checkpoint.owner] == max(owners.values())


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


def test_a_row_that_would_pass_is_not_judged_where_a_gate_waits_whoever_fails(honest):
    """One candidate fails, the other holds in what was asked; without a card nobody is safe."""
    found = row(turned(honest, "D.force_peak_p95_n", "FAIL", "diffusion"), "safety")
    assert found.verdict == NOT_JUDGED and found.waits_for
    assert found.candidates == {"diffusion": "FAIL", "flow": "PASS"}
    assert found.unmet == ("D.force_peak_p95_n (diffusion) FAIL",)


def excepted(reports, *names):
    """The reports, with candidates of whom matching was not asked."""
    why = dict.fromkeys(names, "it is unmatched")
    of_b = reports.judged["B"]
    asked = tuple(c for c in of_b.criteria if c.id not in MATCHING or c.candidate not in names)
    judged = {**reports.judged, "B": of_b.model_copy(update={"criteria": asked})}

    class Excepted(Reports):
        unmatched = why

    return Excepted(reports.root, judged, reports.missing, 0, reports.evidence)


def test_who_is_excepted_from_matching_does_not_carry_a_row_that_asks_for_it(honest):
    reports = excepted(honest, "flow")
    for area in ("evidence", "model", "target"):
        found = row(reports, area)
        assert found.verdict == "PASS"
        assert found.candidates == {"diffusion": "PASS", "flow": UNMATCHED}
        assert "unmatched_keys was not asked of flow: it is unmatched." in found.not_asked
    assert row(reports, "timing").candidates["flow"] == "PASS"
    everybody = row(excepted(honest, "flow", "diffusion"), "model")
    assert everybody.verdict == UNMATCHED
    alone = turned(reports, "D.promotion_e_value", "FAIL", "diffusion")
    assert row(alone, "evidence").verdict == UNMATCHED
    of_b = row(turned(reports, "B.late_change_upper", "FAIL", "diffusion"), "model")
    assert of_b.verdict == UNMATCHED and of_b.candidates["diffusion"] == "FAIL"


def test_the_walk_of_who_is_excepted_is_never_whole(honest):
    found = walk(excepted(honest, "flow"), "flow")
    asked_less = [stop for stop in found.stops if stop.not_asked]
    assert asked_less and {stop.state for stop in asked_less} <= {"in order so far", "not asked"}
    assert found.ended_at is None and not found.whole
    assert "what was not asked stands at its place" in " ".join(walk_text(found).split())
    assert walk(excepted(honest, "flow"), "diffusion").whole


def test_an_exception_is_said_with_who_answers_until_when_and_why(ladder):
    bring(ladder, unmatched=EXCEPTION)
    reports = Reports(ladder, {"B": judge(ladder, "B")}, {g: f"no {g}" for g in "ACDE"}, 0,
                      Evidence(ladder))  # fmt: skip
    found = row(reports, "model")
    assert found.candidates["flow"] == UNMATCHED
    said = "it is unmatched, which the model owner answers for until 2027-01-31 (trained by its "
    assert any(said in text for text in found.not_asked)
    stops = {stop.place: stop for stop in walk(reports, "flow").stops}
    asks = [stop for stop in stops.values() if stop.not_asked]
    assert asks and all(stop.state in ("in order so far", "not asked") for stop in asks)
    assert reports.not_asked("B.unmatched_keys", "diffusion") == ()
    assert reports.not_asked("D.unmatched_starts", "flow") == ()


def test_what_was_waived_is_listed_in_row_and_place(ladder):
    def params(found):
        for entries in found["gate_a"]["limits"].values():
            entries.pop("calibration_residual_m", None)
        found["gate_a"]["not_applicable"] = {
            "perception": {"calibration_residual_m": "no such thing in this cell"}
        }
        found["gate_a"]["waived_checks"] = {"perception": {"of_a_camera": "there is none"}}

    evidence.write_params(ladder, params)
    why = {g: f"no {g}" for g in "BCDE"}
    honest = {"A": read_report(ladder, "A")[0]}
    criteria = tuple(c for c in honest["A"].criteria if c.id != "calibration_residual_m")
    judged = {"A": honest["A"].model_copy(update={"criteria": criteria})}
    reports = Reports(ladder, judged, why, 0, Evidence(ladder))
    waived, question = (
        "calibration_residual_m was not asked: the perception owner says that it does not apply "
        "here (no such thing in this cell).",
        "of_a_camera need not be asked of the data: the perception owner answers for it (there is "
        "none).",
    )
    found = row(reports, "need")
    assert found.verdict == "PASS" and set(found.not_asked) == {waived, question}
    stop = walk(reports, "").stops[0]
    assert stop.state == "in order" and set(stop.not_asked) == {waived, question}
    text = " ".join(checkpoints_text([found]).split())
    assert f"not asked: {waived}" in text
    text = " ".join(walk_text(Walk("", (stop,))).split())
    assert f"not asked: {question}" in text and "every place was asked" not in text
    assert "what was not asked stands at its place" in text
    unanswered = reports.answer("A.calibration_residual_m", "")
    assert not unanswered.waits and waived.rstrip(".") in unanswered.why


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
