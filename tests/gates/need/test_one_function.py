"""A question that gate and cause both ask has one answer: neither is red where the other is not."""

import evidence
import pytest
from asked import settings_of
from editing import cells

from gates.cause.answers import Answer, Topic
from gates.cause.limits import SHARED
from gates.evidence import Evidence
from gates.need import cause
from gates.need.cause import found_cause
from gates.proof import judge

VALID = "valid_modes"


def table(name, **values):
    return lambda root: evidence.edit_table(root, f"audit/{name}.parquet", cells_of(values))


def cells_of(values):
    def change(frame):
        for column, value in values.items():
            frame = cells(column, value, share=0.01)(frame)
        return frame

    return change


def another_mode(phase):
    """A third mode that fails, beside a pair that succeeds."""

    def change(root):
        def add(frame):
            poor = frame.iloc[[0]].assign(mode="third", phase=phase, successes=5, admissible=10)
            poor = poor.assign(success_lower=0.07, success_upper=0.41)
            return evidence.pd.concat([frame, poor], ignore_index=True)

        evidence.edit_table(root, "audit/modes.parquet", add)
        if phase == "approach":
            for name, values in DRAWN.items():
                evidence.edit_table(root, f"audit/{name}.parquet", every_row(values))

    return change


def every_row(values):
    return lambda frame: frame.assign(**{k: [value] * len(frame) for k, value in values.items()})


# What the draws say of three modes.
DRAWN = {
    "resamples": {"success_lower": [0.8, 0.8, 0.07], "admissible": [49, 49, 10]},
    "structure_draws": {"successes": [24, 24, 5]},
}


def offset(question, measured):
    found = evidence.finding(question, measured)
    return lambda root: evidence.edit_table(root, "audit/findings.parquet", lambda _: found)


def only_the_other_evidence_speaks(root):
    def few(document):
        document["counts"]["analysed"] = 10

    evidence.edit_document(root, "audit/summary.json", few)


# What is changed, and whether the cause is still valid modes.
CASES = {
    "as it is": (lambda root: None, True),
    "a large share that luck explains": (
        table("strata", effect=0.8, p_adjusted=0.001, effect_lower=0.05), True),
    "a large share that is sure": (
        table("strata", effect=0.8, p_adjusted=0.001, effect_lower=0.6), False),
    "a failing mode of the only pair": (
        table("modes", successes=5, success_lower=0.07, success_upper=0.41), False),
    "an infeasible mode of the only pair": (table("modes", admissible=10), False),
    "an offset that noise explains": (table("clocks", offset_after_s=0.5), True),
    "an offset that stands out": (offset("clock_residual_s", 0.05), False),
    "a residual that noise explains": (table("calibration", residual_m=0.5), True),
    "a residual that stands out": (offset("calibration_residual_m", 0.05), False),
    "few situations near, many alike": (only_the_other_evidence_speaks, True),
}  # fmt: skip


@pytest.mark.parametrize("name", list(CASES))
def test_gate_and_cause_give_one_answer_to_a_question_that_both_ask(ladder, name):
    change, valid = CASES[name]
    change(ladder)
    answers = {answer.id: answer for answer in judge(ladder, "A").criteria}
    cause = found_cause(Evidence(ladder), settings_of(ladder, "A"))
    red_here = {question for question in SHARED if answers[question].verdict == "FAIL"}
    red_there = {answer.question for answer in cause.answers if answer.red} & set(SHARED)
    assert (cause.name == VALID) == valid
    assert red_here == red_there
    assert bool(red_here) == (not valid)


@pytest.mark.parametrize("phase", ["approach", "retreat"])
def test_a_mode_that_surely_fails_beside_a_good_pair_is_no_target_and_no_cause(ladder, phase):
    """The need is real, and whoever trains on all of the recordings trains on failures too."""
    another_mode(phase)(ladder)
    report = judge(ladder, "A")
    red = {answer.id: answer for answer in report.criteria if answer.verdict == "FAIL"}
    assert set(red) == {"mode_success_lower", "mode_feasible_share"} and report.verdict == "FAIL"
    assert "surely fails" in red["mode_success_lower"].caveat
    assert found_cause(Evidence(ladder), settings_of(ladder, "A")).name == VALID


@pytest.mark.parametrize(
    ("edit", "question"),
    [("an offset that noise explains", "clock_residual_s"),
     ("a residual that noise explains", "calibration_residual_m")],
)  # fmt: skip
def test_a_residual_beyond_the_limit_that_noise_explains_is_not_decided(ladder, edit, question):
    CASES[edit][0](ladder)
    answers = {answer.id: answer for answer in judge(ladder, "A").criteria}
    assert answers[question].verdict == "INCONCLUSIVE"
    assert "0.5 is beyond the limit" in answers[question].caveat


def test_the_number_of_a_pair_is_that_of_its_weaker_mode(ladder):
    answers = {answer.id: answer for answer in judge(ladder, "A").criteria}
    assert "96 % (24 of 25 episodes) succeed" in answers["mode_success_lower"].caveat
    assert answers["mode_success_lower"].interval is not None
    assert answers["mode_feasible_share"].measured == 0.98


def test_numbers_in_another_unit_than_metres_are_held_to_the_same_limit(ladder):
    """Pixels: 100 of them stand for a metre, so 0.2 of them are 2 mm."""
    evidence.edit_document(ladder, "audit/summary.json", lambda d: {**d, "metre": 100.0})
    evidence.edit_table(ladder, "audit/calibration.parquet", lambda f: f.assign(residual_m=0.2))
    answers = {answer.id: answer for answer in judge(ladder, "A").criteria}
    assert answers["calibration_residual_m"].measured == pytest.approx(0.002)
    assert answers["calibration_residual_m"].verdict == "PASS"


def test_an_interval_is_in_the_unit_of_its_number(ladder, monkeypatch):
    """Of pixels, a hundred for a metre, both are told in metres; of what has no length neither."""
    evidence.edit_document(ladder, "audit/summary.json", lambda d: {**d, "metre": 100.0})

    def answered(question, numbers, limits):
        return Answer(question, Topic.DATA, "what", 0.2, 1.0, "<=", interval=(0.1, 0.4))

    monkeypatch.setattr(cause, "deciding_answer", answered)
    settings = settings_of(ladder, "A")
    for question, unit in (("calibration_residual_m", 100.0), ("label_disagreement", 1.0)):
        found = cause.as_the_cause(question, Evidence(ladder), settings)
        assert found.value == pytest.approx(0.2 / unit)
        assert found.interval == pytest.approx((0.1 / unit, 0.4 / unit))


def test_the_confidence_of_the_bounds_is_that_of_the_settings(ladder):
    def sure(confidence):
        evidence.write_params(ladder, lambda params: params.update(confidence=confidence))
        cause = found_cause(Evidence(ladder), settings_of(ladder, "A"))
        return {
            answer.question: answer.measured
            for answer in cause.answers
            if answer.question in ("mode_success_lower", "label_disagreement")
        }

    usual, more = sure(0.95), sure(0.999)
    assert more["mode_success_lower"] < usual["mode_success_lower"]
    assert more["label_disagreement"] > usual["label_disagreement"]
