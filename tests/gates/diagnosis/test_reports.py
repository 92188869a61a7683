"""What a diagnosis stands on: proved reports, and why others cannot be used."""

from dataclasses import replace

import evidence
import pytest

from gates.diagnosis.reports import (
    EVERYBODY,
    NoAnswer,
    gate_and_id,
    read_reports,
    require_candidates,
)
from gates.proof import judge
from gates.report import Answer, report_bytes, report_path
from genpolicy.errors import BadInputError
from genpolicy.integrity.atomic import write_bytes


def test_proved_reports_are_judged_and_the_card_is_said_to_be_missing(ladder):
    found = read_reports(ladder)
    assert set(found.judged) == set("ABCD") and found.untrue == 0
    assert set(found.missing) == {"E"} and "dvc repro gate_e" in found.missing["E"]
    assert found.candidates == ("diffusion", "flow")


def test_a_report_that_is_not_what_the_files_say_is_not_used(ladder):
    path = ladder / report_path("B")
    path.write_bytes(path.read_bytes().replace(b'"verdict": "PASS"', b'"verdict": "FAIL"', 1))
    found = read_reports(ladder)
    assert "B" not in found.judged and found.untrue == 3
    assert found.missing["B"].startswith("gate B cannot be used: ")
    assert not found.missing["B"].endswith("."), "who prints it ends the sentence"


def test_a_report_that_cannot_be_read_is_bad_input(ladder):
    (ladder / report_path("D")).write_text("{")
    assert read_reports(ladder).untrue == 2


def test_of_two_the_one_that_cannot_be_read_decides(ladder):
    path = ladder / report_path("B")
    path.write_bytes(path.read_bytes().replace(b'"verdict": "PASS"', b'"verdict": "FAIL"', 1))
    (ladder / report_path("D")).write_text("{")
    assert read_reports(ladder).untrue == 2


def test_where_nothing_is_judged_the_command_that_builds_it_is_said(repo):
    (repo / "reviewers.yaml").write_text("people: []\n")
    found = read_reports(repo)
    assert found.judged == {} and found.candidates == (EVERYBODY,)
    assert found.missing["A"].endswith("run `dvc repro gate_a`, or `make ladder`")


def test_behind_a_gate_that_does_not_pass_nothing_is_built(ladder):
    for gate in "BCD":
        (ladder / report_path(gate)).unlink()
    assert read_reports(ladder).missing["B"] == (
        "gate B is not judged here: run `dvc repro gate_b`, or `make ladder`"
    )
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    write_bytes(ladder / report_path("A"), report_bytes(judge(ladder, "A")))
    assert read_reports(ladder).missing["B"] == (
        "gate B is not judged: gate A says FAIL, and nothing behind it is built"
    )


def test_an_answer_is_the_candidates_own_or_that_of_the_gate(honest):
    own = honest.answer("D.hold_share_upper", "flow")
    assert isinstance(own, Answer) and own.candidate == "flow"
    gate_wide = honest.answer("D.verdict_reachable", "flow")
    assert isinstance(gate_wide, Answer) and gate_wide.candidate is None


@pytest.mark.parametrize(
    ("name", "candidate", "said"),
    [
        ("E.not_expired", "flow", "gate E is not judged here"),
        ("D.hold_share_upper", "nobody", "nobody does not stand at gate D"),
        ("D.hold_share_upper", EVERYBODY, "asks hold_share_upper of each candidate"),
        ("B.conformance", "flow", "gate B: it was not asked for conformance"),
    ],
)
def test_why_there_is_no_answer(honest, name, candidate, said):
    found = honest.answer(name, candidate)
    assert isinstance(found, NoAnswer) and said in found.why
    assert found.waits == (name != "B.conformance")


def test_settings_are_those_that_judged(honest):
    assert honest.settings("D").planned_starts == 80
    assert honest.settings("D").limits.number("force_peak_p95_n", otherwise=0.0) == 20


def test_candidates_are_asked_for_by_name(honest):
    assert require_candidates(honest, "") == ("diffusion", "flow")
    assert require_candidates(honest, "flow") == ("flow",)
    with pytest.raises(BadInputError, match="expected diffusion, flow"):
        require_candidates(honest, "floww")
    with pytest.raises(BadInputError, match="nobody: no gate has judged"):
        require_candidates(replace(honest, judged={}), "flow")


def test_a_name_has_a_gate_and_a_criterion():
    assert gate_and_id("D.hold_share_upper") == ("D", "hold_share_upper")
    with pytest.raises(KeyError):
        gate_and_id("F.hold_share_upper")
