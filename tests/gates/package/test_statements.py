"""In-toto statements: their form, whom they are about, what they rest on."""

import pytest

from gates.package.statements import statement_of, statement_path
from gates.report import Overridden, read_report


def of(ladder, gate, candidate="flow"):
    report, digest = read_report(ladder, gate)
    return report, statement_of(
        report, digest=digest, candidate=candidate, checkpoint="c" * 64, dataset="d" * 64
    )


@pytest.mark.parametrize("gate", ["A", "B", "C", "D"])
def test_it_has_the_four_fields_of_a_statement(ladder, gate):
    _, found = of(ladder, gate)
    assert set(found) == {"_type", "subject", "predicateType", "predicate"}
    assert found["_type"] == "https://in-toto.io/Statement/v1"
    for subject in found["subject"]:
        assert set(subject) == {"name", "digest"} and len(subject["digest"]["sha256"]) == 64


def test_gate_a_is_about_the_dataset_and_the_others_about_the_checkpoint(ladder):
    first = {gate: of(ladder, gate)[1]["subject"][0] for gate in "AB"}
    assert first["A"]["digest"]["sha256"] == "d" * 64 and "manifest" in first["A"]["name"]
    assert first["B"] == {"name": "checkpoint of flow", "digest": {"sha256": "c" * 64}}


def test_it_names_the_report_and_all_that_the_report_names(ladder):
    report, found = of(ladder, "D")
    _, digest = read_report(ladder, "D")
    assert found["subject"][1]["digest"]["sha256"] == digest
    predicate = found["predicate"]
    assert predicate["materials"] == report.materials and report.materials
    assert predicate["upstream"] == report.upstream and predicate["code"] == report.code
    assert predicate["caveats"] == list(report.caveats)


def test_it_carries_every_exception_as_data(ladder):
    """By fields, so that a machine need not read the caveats to see what a PASS stands on."""
    report, digest = read_report(ladder, "D")
    entry = Overridden(
        gate="C", criterion="x", candidate=None, comparison="<=", threshold=1.0, limit=2.0,
        by="rita", reason="r", expires="2026-12-24", verdict="FAIL", instead="PASS",
        without="FAIL",
    )  # fmt: skip
    held = report.model_copy(update={"overrides": (entry,)})
    named = {"digest": digest, "candidate": "flow", "checkpoint": "c" * 64, "dataset": "d" * 64}
    found = statement_of(held, **named)
    assert found["predicate"]["overrides"] == [entry.model_dump(mode="json")]
    assert found["predicateType"] == "urn:genpolicy:gate-verdict:2"
    assert statement_of(report, **named)["predicate"]["overrides"] == []


def test_it_says_the_verdict_of_this_candidate(ladder):
    report, found = of(ladder, "B")
    assert found["predicate"]["of_candidate"] == report.candidates["flow"]
    assert of(ladder, "B", "nobody")[1]["predicate"]["of_candidate"] is None
    assert of(ladder, "D", "nobody")[1]["predicate"]["promoted"] is False


def test_each_gate_has_a_place_of_its_own():
    assert statement_path("D") == "statements/gate_d.json"
