"""Findings at recorded moments: each alone is red by name, and what must be known is known."""

import evidence
import pytest

from gates.proof import judge
from gates.reproducibility.conformance import NEEDED
from genpolicy.candidates.conformance.finding import OF_ANSWERS
from genpolicy.errors import ConfigError
from tests.gates.reproducibility.test_brought import EXCEPTION, FINDINGS, bring, of_flow


def said(name, judged, said="what was seen"):
    """Findings of which one is judged otherwise."""
    other = {"judged": judged, "said": said}
    return [one | (other if one["name"] == name else {}) for one in FINDINGS]


def judged(root, findings):
    bring(root, unmatched=EXCEPTION, findings=findings)
    return judge(root, "B")


def test_it_is_asked_of_who_was_brought_and_of_nobody_else(ladder):
    report = judged(ladder, None)
    answers = [item for item in report.criteria if item.id == "conformance"]
    assert [(item.candidate, item.verdict, item.measured) for item in answers] == [
        ("flow", "PASS", 0.0)
    ]
    assert answers[0].counted == "40 held-out episodes, 40 recorded moments"
    assert answers[0].evidence == ("artifacts/reload/conformance.json",)


@pytest.mark.parametrize("name", OF_ANSWERS)
def test_each_finding_that_fails_is_red_alone_and_named(ladder, name):
    report = judged(ladder, said(name, "fails", "off by a thousand"))
    assert report.candidates == {"diffusion": "PASS", "flow": "FAIL"}
    answer = of_flow(report, "conformance")
    assert (answer.verdict, answer.measured) == ("FAIL", 1.0)
    assert answer.caveat.startswith(f"{name}: off by a thousand; holds: ")
    red = {item.id for item in report.criteria if item.verdict == "FAIL"}
    assert red == {"conformance"}


@pytest.mark.parametrize("name", OF_ANSWERS)
def test_what_must_be_known_is_inconclusive_and_the_rest_is_named(ladder, name):
    answer = of_flow(judged(ladder, said(name, "unknown", "nobody saw")), "conformance")
    if name in NEEDED:
        assert (answer.verdict, answer.measured) == ("INCONCLUSIVE", None)
        assert f"{name}: nobody saw" in answer.caveat
    else:
        assert (answer.verdict, answer.measured) == ("PASS", 0.0)
        assert f"unknown: {name}" in answer.caveat


def test_a_finding_that_fails_decides_though_another_is_unknown(ladder):
    findings = [
        one | {"judged": {"restarts": "unknown", "scale": "fails"}.get(one["name"], "holds")}
        for one in FINDINGS
    ]
    answer = of_flow(judged(ladder, findings), "conformance")
    assert (answer.verdict, answer.measured) == ("FAIL", 1.0)


@pytest.mark.parametrize("name", OF_ANSWERS)
def test_a_finding_that_is_left_out_is_no_pass(ladder, name):
    left = [one for one in FINDINGS if one["name"] != name]
    answer = of_flow(judged(ladder, left), "conformance")
    assert answer.verdict == "INCONCLUSIVE"
    assert f"nothing is said of {name}" in answer.caveat


def test_without_the_document_or_its_entry_nothing_is_known(ladder):
    bring(ladder, unmatched=EXCEPTION)
    for found in ({}, None):
        if found is None:
            evidence.replace(ladder, "reload/conformance.json", None)
        else:
            evidence.document(ladder, "reload/conformance.json", found)
            evidence.record(ladder)
        assert of_flow(judge(ladder, "B"), "conformance").verdict == "INCONCLUSIVE"


def test_it_cannot_be_declared_not_applicable(ladder):
    bring(ladder, unmatched=EXCEPTION)

    def waived(params):
        del params["gate_b"]["limits"]["model"]["conformance"]
        params["gate_b"]["not_applicable"] = {"model": {"conformance": "no time"}}

    evidence.write_params(ladder, waived)
    with pytest.raises(ConfigError, match="conformance"):
        judge(ladder, "B")
