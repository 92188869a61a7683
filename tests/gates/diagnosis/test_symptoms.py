"""Every symptom of the chapter: a planted cause is named, and where none is nothing is said."""

import re
from pathlib import Path

import evidence
import pytest
from causes_planted import CAUSES, FLOW, jumps, table
from test_walk import turned

from gates.diagnosis.reports import EVERYBODY, Reports
from gates.diagnosis.symptoms import SYMPTOMS, answered, symptoms_of
from gates.evidence import Evidence
from genpolicy.errors import BadInputError

CHAPTER = (
    ("samples diverse but unsuccessful", "whether modes map to task condition",
     "feasibility and selector leakage", "diversity proves multimodal understanding"),
    ("action lies between modes", "alignment and hidden state", "chunked BC and ACT baseline",
     "diffusion needs more steps"),
    ("jump at chunk boundary", "H_e, replanning, blending", "normalization and queue age",
     "only architecture is wrong"),
    ("flow wins a microbenchmark", "preprocessing, projection, queue accounting",
     "rejection/resample and p95", "end-to-end is faster"),
    ("oscillation at contact", "stale action and phase transition",
     "gains, action rate, projection", "generator cannot learn contact"),
    ("simulation passes, hardware fails", "camera, calibration, latency, contact gap",
     "action age and controller mode", "only more data are needed"),
    ("seed variance is large", "sampler seeds and reset bins", "training seeds and mode coverage",
     "one mean is stable evidence"),
    ("projection is frequent", "raw sample distribution",
     "representation and feasible conditioning", "supervisor is too conservative"),
    ("OOD does not stop", "threshold and probe coverage", "watchdog/fallback wiring",
     "uncertainty owns safety"),
)  # fmt: skip
"""The table of chapter 6, section 7, by hand."""
UNRECORDED = {
    "diverse-unsuccessful", "boundary-jump", "fast-microbenchmark", "contact-oscillation",
    "simulation-only", "seed-variance", "frequent-projection", "ood-does-not-stop",
}  # fmt: skip
"""Symptoms of which something is recorded nowhere, even in an honest tree."""
KNOWN = "elsewhere: all that the row names was asked, and holds"
PARTLY = "for what is not known: what could be asked holds, and the rest is open"


def test_the_rows_are_the_chapters_in_its_order():
    rows = tuple((s.row, s.first.at, s.then.at, s.do_not_conclude) for s in SYMPTOMS)
    assert rows == CHAPTER


@pytest.mark.parametrize("symptom", SYMPTOMS, ids=lambda one: one.name)
def test_in_an_honest_tree_nothing_speaks_and_numbers_are_shown(honest, symptom):
    found = answered(symptom, honest, FLOW)
    assert found.first.causes == found.then.causes == ()
    assert not found.found and found.answerable and found.before_all == ""
    for asked in (found.first, found.then):
        assert asked.query.endswith("?")
        assert asked.numbers, asked.at
        for number in asked.numbers:
            assert number.value and re.match(r"reports/|artifacts/|params\.yaml", number.where)
            assert (honest.root / number.where.partition(":")[0].split(",")[0]).is_file()
    known = found.first.holds and found.then.holds
    assert known == (symptom.name not in UNRECORDED)
    assert found.look_next == (KNOWN if known else PARTLY)


@pytest.mark.parametrize("name", ["ood-does-not-stop", "simulation-only", "seed-variance"])
def test_what_comes_first_is_not_said_to_hold_where_nobody_recorded_it(honest, name):
    then = {"ood-does-not-stop": "C.mutants_undetected", "simulation-only": "D.latency_p95_s",
            "seed-variance": "B.mode_coverage_lower"}[name]  # fmt: skip
    (symptom,) = symptoms_of(name)
    who = next(c.candidate for c in honest.judged[then[0]].criteria
               if c.id == then[2:] and c.candidate in (None, FLOW))  # fmt: skip
    found = answered(symptom, turned(honest, then, "FAIL", who), FLOW)
    assert (
        found.look_next == f"at what speaks next ({symptom.then.at}); what comes first is not known"
    )


def test_where_the_first_is_open_it_is_not_said_to_hold(honest):
    (symptom,) = symptoms_of("between-modes")
    broken = turned(honest, "A.chunking_valid_share", "FAIL")
    assert answered(symptom, broken, FLOW).look_next.endswith("; what comes first holds")
    shown = turned(broken, "B.outside_modes_upper", "INCONCLUSIVE", FLOW)
    assert answered(symptom, shown, FLOW).look_next.endswith("; what comes first is not known")
    found = answered(symptom, turned(broken, "A.told_share", "INCONCLUSIVE"), FLOW)
    assert found.undecided and not found.first.holds
    assert found.look_next.endswith("; what comes first is not decided")
    open_one = answered(symptom, turned(honest, "A.told_share", "INCONCLUSIVE"), FLOW)
    assert open_one.look_next == (
        f"at what is not decided ({symptom.first.at}): what it says may be the cause"
    )


@pytest.mark.parametrize(
    ("name", "criterion"),
    [("boundary-jump", "C.boundary_jerk_p95_m_s3"), ("frequent-projection", "C.projection_p95_m")],
)
def test_the_symptom_is_not_its_own_cause(honest, name, criterion):
    (symptom,) = symptoms_of(name)
    found = answered(symptom, turned(honest, criterion, "FAIL", FLOW), FLOW)
    assert not found.found and found.look_next == (
        "elsewhere for the cause: the symptom is there, and no cause that was asked speaks"
    )


@pytest.mark.parametrize(
    ("name", "inspection", "edit", "gates", "said"),
    CAUSES,
    ids=[f"{name}, {inspection}: {said[:24]}" for name, inspection, _, _, said in CAUSES],
)
def test_a_planted_cause_is_named_where_the_row_looks_for_it(
    planted, name, inspection, edit, gates, said
):
    (symptom,) = symptoms_of(name)
    found = answered(symptom, planted(edit, gates), FLOW)
    assert any(said in cause for cause in getattr(found, inspection).causes)
    assert found.found
    if found.first.causes:
        assert (
            found.look_next
            == f"at what speaks first ({symptom.first.at}), and ask again when it is mended"
        )
    else:
        first = "holds" if found.first.holds else "is not known"
        assert (
            found.look_next == f"at what speaks next ({symptom.then.at}); what comes first {first}"
        )


def _right_and_seldom_failing(frame):
    """Flow goes right on odd starts and fails on every fifth of these: certain, and no failure."""
    right = (frame["method"] == FLOW) & (frame["start"] % 2 == 1)
    frame.loc[right, "mode"] = "right"
    frame.loc[right & (frame["start"] % 10 == 1), ["success", "outcome"]] = [False, "collision"]
    return frame


@pytest.mark.parametrize(
    ("name", "edit"),
    [
        ("boundary-jump", table("stress/splices.parquet", jumps("raw_jump_m", 1.5))),
        ("boundary-jump", table("stress/splices.parquet", jumps("jump_m", 3.0))),
        ("diverse-unsuccessful", table("stress/rollouts.parquet", _right_and_seldom_failing)),
    ],
)
def test_a_difference_that_does_not_matter_says_nothing(planted, name, edit):
    (symptom,) = symptoms_of(name)
    assert not answered(symptom, planted(edit, ""), FLOW).found


def test_who_does_not_win_the_microbenchmark_is_accused_of_no_slower_answer(honest):
    (symptom,) = symptoms_of("fast-microbenchmark")
    assert not answered(symptom, honest, "diffusion").found


def test_every_inspection_has_a_planted_cause():
    named = {(name, inspection) for name, inspection, *_ in CAUSES}
    assert named == {(s.name, inspection) for s in SYMPTOMS for inspection in ("first", "then")}


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("diverse-unsuccessful", "whether the selector knows more"),
        ("contact-oscillation", "how force and position swing in contact"),
        ("contact-oscillation", "gains of the controller"),
        ("simulation-only", "no rollout on hardware is recorded"),
        ("simulation-only", "declared and not measured"),
        ("seed-variance", "noise alone"),
        ("seed-variance", "one training seed"),
        ("ood-does-not-stop", "what is out of distribution in your cell"),
    ],
)
def test_what_the_ladder_does_not_record_is_said_to_be_unknown(honest, name, said):
    (symptom,) = symptoms_of(name)
    found = answered(symptom, honest, FLOW)
    assert any(said in text for text in (*found.first.unknown, *found.then.unknown))
    assert found.look_next == PARTLY


def test_a_second_training_is_no_longer_unknown(planted):
    (edit,) = [edit for *_, edit, _, said in CAUSES if said.startswith("trainings differ")]
    (symptom,) = symptoms_of("seed-variance")
    found = answered(symptom, planted(edit, "D"), FLOW)
    assert not any("one training seed" in text for text in found.then.unknown)


def test_what_comes_first_in_the_order_is_said_before_all(planted):
    edit, gates = next((e, g) for *_, e, g, said in CAUSES if said.startswith("lag_spread"))
    (symptom,) = symptoms_of("boundary-jump")
    found = answered(symptom, planted(edit, gates), FLOW)
    assert found.before_all == "data semantics (place 1 of 9) is RED" and not found.found


@pytest.mark.parametrize("symptom", SYMPTOMS, ids=lambda one: one.name)
def test_without_any_report_nothing_is_answered_and_what_builds_it_is_said(honest, symptom):
    why = {gate: f"gate {gate}: make ladder" for gate in "ABCDE"}
    bare = Reports(Path("nowhere"), {}, why, 0, honest.evidence)
    found = answered(symptom, bare, EVERYBODY)
    assert not found.answerable and not found.found
    assert any("make ladder" in text for text in (*found.first.waits_for, *found.then.waits_for))
    assert found.look_next == "for what is not known: nothing could be asked"


def test_a_table_that_is_gone_is_unknown_and_stops_no_other_number(planted):
    def gone(root):
        (root / "artifacts/stress/splices.parquet").unlink()

    (symptom,) = symptoms_of("boundary-jump")
    found = answered(symptom, planted(gone, ""), FLOW)
    assert any("splices.parquet is missing" in text for text in found.first.unknown)
    assert any("discarded" in number.what for number in found.first.numbers)


def test_a_name_that_is_no_symptom_lists_those_that_are():
    assert symptoms_of("all") == SYMPTOMS
    with pytest.raises(BadInputError, match="boundary-jump") as caught:
        symptoms_of("jump")
    assert caught.value.exit_code == 2


def test_a_question_to_the_data_that_an_owner_waived_is_not_known(ladder, honest):
    """It is in no number: a defect that nobody looked for is no defect that was not found."""

    def waive(params):
        params["gate_a"]["waived_checks"] = {"perception": {"of_a_camera": "there is none"}}

    evidence.write_params(ladder, waive)
    reports = Reports(ladder, honest.judged, honest.missing, 0, Evidence(ladder))
    found = answered(next(s for s in SYMPTOMS if s.name == "between-modes"), reports, FLOW)
    assert any(text.startswith("of_a_camera need not be asked") for text in found.first.unknown)
    assert found.look_next == PARTLY
