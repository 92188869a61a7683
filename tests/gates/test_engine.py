"""The engine: what is missing is named, and without a limit nothing passes."""

import importlib.metadata
import json
import sys
from dataclasses import replace

import pytest
from asking import SPEC

from gates.criterion import Measured
from gates.engine import judge, promoted_below, upstream_hashes
from gates.evidence import Evidence, MissingEvidenceError
from gates.installed import LIBRARIES, environment
from gates.more import ASTRIDE, INSIDE
from gates.pipeline import TASK_IDENTITY, Basis
from gates.report import report_bytes, report_path
from gates.settings import GateSettings, Limit, Limits, Waiver


def _write(tmp_path, name, document):
    (tmp_path / "in").mkdir(exist_ok=True)
    (tmp_path / "in" / name).write_text(json.dumps(document))


def _judge(tmp_path, a, b, **limits):
    _write(tmp_path, "a.json", {"n": a})
    _write(tmp_path, "b.json", {"n": b})
    _write(tmp_path, "c.json", {})
    (tmp_path / TASK_IDENTITY).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / TASK_IDENTITY).write_text("{}")
    return judge(SPEC, Evidence(tmp_path), Limits(**limits), GateSettings())


def test_evidence_is_what_was_read_and_materials_are_all(tmp_path):
    report = _judge(tmp_path, 1, 1)
    assert [answer.evidence for answer in report.criteria] == [
        ("in/a.json",),
        ("in/a.json", "in/b.json"),
    ]
    assert set(report.materials) == {"in/a.json", "in/b.json", "in/c.json", TASK_IDENTITY}


def test_evidence_that_is_missing_is_named(tmp_path):
    report = judge(SPEC, Evidence(tmp_path), Limits(), GateSettings())
    assert report.criteria[0].evidence == ("in/a.json",)
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


@pytest.mark.parametrize(
    ("shown", "verdict"), [("it was there", "INCONCLUSIVE"), ("", "PASS"), (None, "PASS")]
)
def test_what_was_declared_not_to_apply_is_asked_where_the_evidence_shows_it(
    tmp_path, shown, verdict
):
    def applies(evidence, settings):
        if shown is None:
            raise MissingEvidenceError("nobody looked")
        return shown

    first, second = SPEC.criteria
    spec = replace(SPEC, criteria=(first, replace(second, applies=applies)))
    limits = {first.id: Limit(1.0, "r", "model")}
    waived = {second.id: Waiver("no such thing here", "controller")}
    _judge(tmp_path, 1, 1)
    report = judge(spec, Evidence(tmp_path), Limits(limits, waived), GateSettings())
    assert report.verdict == verdict
    assert any("no such thing here" in text for text in report.caveats)
    told = [answer.reason for answer in report.criteria if answer.id == second.id]
    assert told == (["declared not applicable, but it was there"] if shown else [])


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


def test_a_document_of_another_form_is_not_measured_and_no_fault(tmp_path, monkeypatch):
    def measure(evidence, settings):
        return {}["no such key"]

    first, *others = SPEC.criteria
    spec = replace(SPEC, criteria=(replace(first, measure=measure), *others))
    _write(tmp_path, "a.json", {})
    report = judge(spec, Evidence(tmp_path), Limits(), GateSettings())
    assert "not measured: the evidence has no 'no such key'" in report.criteria[0].caveat
    assert "a.json is a document with the missing key n" in report.criteria[1].caveat
    assert report.verdict == "INCONCLUSIVE"


def test_what_no_run_stands_for_does_not_pass(tmp_path):
    of = {"second_in_the_alphabet": Limit(1.0, "r", "model")}
    waived = {"first_in_the_alphabet": Waiver("no such thing here", "controller")}
    assert _judge(tmp_path, 1, 99, of=of, waived=waived).verdict == "PASS"
    evidence = Evidence(tmp_path, Basis(unrecorded=("stress",)))
    report = judge(SPEC, evidence, Limits(of=of, waived=waived), GateSettings())
    assert (report.verdict, report.promoted) == ("INCONCLUSIVE", None)
    assert report.caveats[-1].endswith("dvc.lock holds no run of stress.")


def _asked(tmp_path, measured, **limits):
    """The engine's answer to a criterion that measures just this."""
    first = replace(SPEC.criteria[0], measure=lambda evidence, settings: measured)
    _write(tmp_path, "a.json", {})
    spec = replace(SPEC, criteria=(first,))
    of = {"<lambda>": Limit(1.0, "r", "model")} if not limits else limits["of"]
    return judge(spec, Evidence(tmp_path), Limits(of=of), GateSettings()).criteria[0]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_what_is_no_number_is_not_measured(tmp_path, value):
    answer = _asked(tmp_path, Measured(value, (0.0, 1.0)))
    assert (answer.measured, answer.verdict) == (None, "INCONCLUSIVE")


def test_a_person_is_waited_for_only_where_they_can_still_decide(tmp_path):
    assert _asked(tmp_path, Measured(None, pending=True)).verdict == "PENDING_REVIEW"
    assert _asked(tmp_path, Measured(0.0, pending=True)).verdict == "PENDING_REVIEW"
    assert _asked(tmp_path, Measured(1.0, pending=True)).verdict == "PASS"
    assert _asked(tmp_path, Measured(0.0)).verdict == "FAIL"
    assert _asked(tmp_path, Measured(1.0, pending=True), of={}).verdict == "INCONCLUSIVE"


def test_astride_is_said_only_of_a_number_with_a_limit_that_is_not_decided(tmp_path):
    inside = _asked(tmp_path, Measured(0.5, (0.5, 2.0), "seen"))
    assert (inside.verdict, inside.caveat) == ("INCONCLUSIVE", f"seen; {ASTRIDE}")
    assert _asked(tmp_path, Measured(0.5, (0.5, 2.0))).caveat == ASTRIDE
    for measured in (Measured(0.5), Measured(2.0), Measured(None)):
        assert _asked(tmp_path, measured).caveat == ""


def test_where_the_share_that_was_seen_is_known_it_is_said_how_many_more_decide(tmp_path):
    """Limit 1, at least: 1.5 was seen, its lower end .5 is as far below as the share above."""
    found = _asked(tmp_path, Measured(0.5, (0.5, 2.0), counted="9 episodes", point=1.5))
    more = "about 4 times as many (9 episodes now) show that it holds, if they say the same"
    assert found.caveat == f"{INSIDE}: {more}"
    assert _asked(tmp_path, Measured(1.0), of={}).caveat == ""


def test_number_and_interval_are_rounded_before_they_are_judged(tmp_path):
    answer = _asked(tmp_path, Measured(1.0 - 1e-14, (0.1 + 0.2, 1.0 + 1e-14)))
    assert (answer.measured, answer.interval, answer.verdict) == (1.0, (0.3, 1.0), "PASS")


def test_the_environment_names_python_by_its_minor_version():
    """A patch release of Python changes no number; a report is not void for it."""
    assert environment()["python"] == f"{sys.version_info[0]}.{sys.version_info[1]}"


def test_the_environment_names_what_the_numbers_come_from():
    """Networks, the simulated arm, the kinematics and the audit's estimators, beside the tables."""
    judging = {"torch", "mujoco", "pin", "scikit-learn", "numpy", "pandas", "pyarrow", "scipy"}
    assert judging <= set(environment())
    assert environment()["torch"] == importlib.metadata.version("torch")


def test_versions_are_those_that_the_installer_wrote():
    found = environment()
    assert {name: found[name] for name in LIBRARIES} == {
        name: importlib.metadata.version(name) for name in LIBRARIES
    }


@pytest.mark.parametrize(
    "metadata",
    [
        "Metadata-Version: 2.4\nName: a\nVersion: 1.0\n\nVersion: 2.0\n",
        "Name: a\nLicense: x\n        Version: 3\nVersion:1.0\nRequires-Dist: b\n\nText",
        "name: a\nversion: 1.0\n\nVersion: 2.0\n",
    ],
)
def test_a_library_that_is_not_installed_is_left_out(monkeypatch, metadata):
    class Installed(importlib.metadata.Distribution):
        def read_text(self, filename):
            return metadata if filename == "METADATA" else None

        def locate_file(self, path):
            return path

    def distribution(name):
        if name == "pin":
            raise importlib.metadata.PackageNotFoundError(name)
        return Installed()

    monkeypatch.setattr(importlib.metadata, "distribution", distribution)
    assert "pin" not in environment() and environment()["torch"] == "1.0"


def _below(tmp_path, gate, **candidates):
    """A report of a gate that gives these verdicts."""
    report = _judge(tmp_path, 1, 1).model_copy(update={"gate": gate, "candidates": candidates})
    path = tmp_path / report_path(gate)
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(report_bytes(report))
    return path


def test_who_passed_below_stands_and_why_the_others_do_not(tmp_path):
    _below(tmp_path, "B", flow="PASS", act="FAIL", new="INCONCLUSIVE")
    stands, why = promoted_below(tmp_path, "B", ["act", "flow", "other"])
    assert stands == ["flow"]
    assert [text.split()[0] for text in why] == ["act", "other"]
    assert "gate B says FAIL" in why[0] and "gate B says nothing" in why[1]


def test_gate_a_judges_no_method_and_lets_all_stand(tmp_path):
    _below(tmp_path, "A")
    assert promoted_below(tmp_path, "A", ["act", "flow"]) == (["act", "flow"], [])


@pytest.mark.parametrize("data", [None, b"", b"{}", b"no report"])
def test_on_a_report_that_cannot_be_read_no_method_stands(tmp_path, data):
    path = _below(tmp_path, "B", flow="PASS")
    path.unlink() if data is None else path.write_bytes(data)
    stands, (why,) = promoted_below(tmp_path, "B", ["flow"])
    assert stands == [] and "Gate B has no readable report" in why
    # Gate A judges no method: they stand, and it is said that nothing is under them.
    stands, (why,) = promoted_below(tmp_path, "A", ["flow"])
    assert stands == ["flow"] and "Gate A has no readable report" in why


def test_the_reports_below_are_bound_and_no_others(tmp_path):
    for gate in "ABD":
        _below(tmp_path, gate)
    assert set(upstream_hashes(tmp_path, "D")) == {"A", "B"}
    assert upstream_hashes(tmp_path, "A") == {}


def test_a_pass_needs_no_diagnosis_and_what_no_criterion_stops_is_said(tmp_path):
    limits = {
        "second_in_the_alphabet": Limit(0.0, "for a test", "model"),
        "first_in_the_alphabet": Limit(2.0, "for a test", "model"),
    }
    passed = _judge(tmp_path, 1, 1, of=limits)
    (tmp_path / TASK_IDENTITY).unlink()
    lacking = judge(SPEC, Evidence(tmp_path), Limits(of=limits), GateSettings())
    # A record of the pipeline lacks in both: `_judge` writes the task's identity alone.
    for report in (passed, lacking):
        assert all(answer.verdict == "PASS" for answer in report.criteria)
        assert (report.diagnosis == "") == (report.verdict == "PASS"), report.diagnosis
    assert lacking.verdict != "PASS" and lacking.diagnosis.startswith("No criterion decided")
