"""A criterion: named by its function, ordered by definition, its evidence what it read."""

import json
import types

import pytest

from gates.criterion import Criterion, Measured, criteria_of, criterion
from gates.engine import GateSpec, judge
from gates.evidence import Evidence
from gates.proof import SPECS
from gates.settings import GateSettings, Limit, Limits, Waiver


@criterion(">=", question="Many?", look_at="Look.")
def second_in_the_alphabet(evidence: Evidence, settings: GateSettings) -> Measured:
    """A number of one file."""
    return Measured(evidence.document("a.json")["n"])


@criterion("<=", question="Few?", look_at="Look.", derived=lambda settings: 2.0)
def first_in_the_alphabet(evidence: Evidence, settings: GateSettings) -> Measured:
    """A number of two files, one of which is read twice."""
    evidence.document("a.json")
    return Measured(evidence.document("b.json")["n"] + evidence.document("a.json")["n"])


SPEC = GateSpec("A", GateSettings, criteria_of(globals()), ("*.json",), "work", "go on", ())


def _judge(tmp_path, a, b, **limits):
    (tmp_path / "a.json").write_text(json.dumps({"n": a}))
    (tmp_path / "b.json").write_text(json.dumps({"n": b}))
    (tmp_path / "c.json").write_text("{}")
    return judge(SPEC, Evidence(tmp_path), Limits(**limits), GateSettings())


def test_identifier_is_the_functions_name_and_order_that_of_definition():
    assert [item.id for item in SPEC.criteria] == [
        "second_in_the_alphabet", "first_in_the_alphabet",
    ]  # fmt: skip


def test_what_a_module_only_imports_is_not_its_own():
    module = types.ModuleType("another")
    module.borrowed = second_in_the_alphabet
    assert criteria_of(vars(module)) == ()


def test_evidence_is_what_was_read_and_materials_are_all(tmp_path):
    report = _judge(tmp_path, 1, 1)
    assert [answer.evidence for answer in report.criteria] == [("a.json",), ("a.json", "b.json")]
    assert set(report.materials) == {"a.json", "b.json", "c.json"}


def test_evidence_that_is_missing_is_named(tmp_path):
    report = judge(SPEC, Evidence(tmp_path), Limits(), GateSettings())
    assert report.criteria[0].evidence == ("a.json",)
    assert "a.json is missing" in report.criteria[0].caveat


def test_without_a_limit_nobody_answers_and_nothing_passes(tmp_path):
    report = _judge(tmp_path, 1, 1)
    assert report.verdict == "INCONCLUSIVE"
    assert {(answer.owner, answer.threshold) for answer in report.criteria} == {(None, None)}


@pytest.mark.parametrize(("b", "verdict"), [(0, "PASS"), (3, "FAIL")])
def test_a_derived_limit_follows_from_the_settings(tmp_path, b, verdict):
    limits = {
        "second_in_the_alphabet": Limit(1.0, "r", "model"),
        "first_in_the_alphabet": Limit(None, "r", "safety"),
    }
    report = _judge(tmp_path, 1, b, of=limits)
    assert (report.verdict, report.criteria[1].threshold) == (verdict, 2.0)


def test_what_does_not_apply_is_a_caveat_and_decides_nothing(tmp_path):
    of = {"second_in_the_alphabet": Limit(1.0, "r", "model")}
    waived = {"first_in_the_alphabet": Waiver("no such thing here", "controller")}
    report = _judge(tmp_path, 1, 99, of=of, waived=waived)
    assert report.verdict == "PASS"
    assert [answer.id for answer in report.criteria] == ["second_in_the_alphabet"]
    (caveat,) = report.caveats
    assert "first_in_the_alphabet" in caveat and "controller" in caveat
    assert "no such thing here" in caveat
    nothing = _judge(
        tmp_path, 1, 1, waived={item.id: Waiver("r", "model") for item in SPEC.criteria}
    )
    assert nothing.verdict == "INCONCLUSIVE"


def test_every_gate_asks_each_question_once():
    for spec in SPECS.values():
        names = [item.id for item in spec.criteria]
        assert len(names) == len(set(names)) >= 7
        assert all(isinstance(item, Criterion) and item.measure.__doc__ for item in spec.criteria)


def test_what_guards_people_or_the_proof_always_applies():
    always = {gate: {i.id for i in s.criteria if i.always} for gate, s in SPECS.items()}
    assert always["C"] == {
        "stub_stale", "stub_invalid", "stub_violation_upper", "conservation_error",
        "checker_violations", "mutants_undetected",
    }  # fmt: skip
    assert always["D"] == {
        "stub_violations", "conservation_error", "checker_violations", "promotion_e_value",
    }  # fmt: skip
    assert always["E"] == {item.id for item in SPECS["E"].criteria}
