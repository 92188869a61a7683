"""The command line on a ladder: exit codes, one-sentence errors, no traceback."""

import json
import shutil
import sys
from dataclasses import dataclass

import evidence
import pytest
from test_differences import REPORT
from test_verdicts import criterion

from gates.card.commands import card
from gates.commands import gates
from gates.preregistration import PREREGISTRATION, plan_bytes
from gates.proof import STAGE_REQUIRES
from gates.report import GateReport
from gates.settings import read_params
from genpolicy.cli.shell import run_program
from genpolicy.errors import RefusedError


@dataclass(frozen=True)
class Result:
    exit_code: int
    output: str


@pytest.fixture
def _run(capsys):
    def run(root, *args):
        code = run_program(gates, "gates", [*args, "--root", str(root)])
        printed = capsys.readouterr()
        return Result(code, printed.out + printed.err)

    return run


def _clean(result):
    assert "Traceback" not in result.output


def test_a_report_is_shown_as_it_lies_there_line_by_line(tmp_path, _run, monkeypatch):
    ours = criterion("FAIL", "flow", "nfe")
    report = REPORT.model_copy(update={"criteria": (*REPORT.criteria, ours)})
    monkeypatch.setattr("gates.report.read_report", lambda root, gate: (report, "0123456789abcdef"))
    head = "Gate A: PASS  (report 0123456789ab, not proved)\nDecision: Go on.\n"
    rows = "  PASS           x: 1, required <= 1\n  FAIL           nfe (flow): 1, required <= 1\n"
    assert _run(tmp_path, "show", "a") == Result(0, head + rows)
    report = report.model_copy(update={"diagnosis": "Broken."})
    assert _run(tmp_path, "show", "gate_a") == Result(0, f"{head}Diagnosis: Broken.\n{rows}")
    as_json = _run(tmp_path, "show", "Gate_A", "--json").output
    assert GateReport.model_validate_json(as_json) == report
    assert as_json.startswith('{\n  "schema_version": 1,\n')


def test_check_passes_through_d_and_not_through_e(ladder, _run):
    assert _run(ladder, "check").exit_code == 0
    result = _run(ladder, "check", "--through", "E")
    assert result.exit_code == 3
    assert "NOT JUDGED" in result.output


def test_check_says_3_for_a_verdict_2_for_what_cannot_be_read_and_never_1(ladder, _run):
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    assert _run(ladder, "judge", "A").exit_code == 0
    assert _run(ladder, "check", "--through", "A").exit_code == 3
    (ladder / "reports" / "gate_a.json").write_text("{")
    assert _run(ladder, "check", "--through", "A").exit_code == 2
    assert _run(ladder, "verify").exit_code == 2


def test_summary_prints_one_line_per_stage_and_exits_0(ladder, _run):
    result = _run(ladder, "summary")
    assert result.exit_code == 0
    stages = [line.split()[0] for line in result.output.splitlines()[1 : 1 + len(STAGE_REQUIRES)]]
    assert stages == list(STAGE_REQUIRES)
    assert "reports/index.html" not in result.output, "a page that is not there is not announced"
    (ladder / "reports" / "index.html").write_text("")
    assert "reports/index.html" in _run(ladder, "summary").output
    as_json = _run(ladder, "summary", "--json")
    assert as_json.exit_code == 0
    rows = json.loads(as_json.output)
    verdicts = {row["stage"]: row["verdict"] for row in rows}
    assert [verdicts[f"gate_{letter}"] for letter in "abcd"] == ["PASS"] * 4


@pytest.fixture(autouse=True)
def _no_journals(monkeypatch):
    """The journals of this evidence are no journals; tests/gates/test_rederive.py has some."""
    monkeypatch.setattr("gates.rederive.rederive", lambda root, gate: None)


def test_verify_asks_the_journals_too(ladder, _run, monkeypatch):
    def differs(root, gate):
        if gate == "D":
            raise RefusedError(
                gate="D", criterion="rollout", measured="1", limit="0", report="r", action="Stop."
            )

    monkeypatch.setattr("gates.rederive.rederive", differs)
    result = _run(ladder, "verify")
    assert result.exit_code == 3
    assert "Gate D refuses: rollout is 1" in result.output


def test_verify_finds_a_changed_byte(ladder, _run):
    assert _run(ladder, "verify").exit_code == 0
    file = ladder / "artifacts/reload/identity.json"
    file.write_bytes(file.read_bytes() + b" ")
    result = _run(ladder, "verify")
    _clean(result)
    assert result.exit_code == 3
    assert "identity.json" in result.output


@pytest.mark.parametrize("command", [("verify",), ("check", "--through", "A")])
def test_a_front_page_that_says_other_than_the_reports_refuses(ladder, _run, command):
    assert _run(ladder, "judge", "A").exit_code == 0
    assert _run(ladder, *command).exit_code == 0
    page = ladder / "reports" / "index.html"
    page.write_text(page.read_text().replace("PASS", "FAIL", 1))
    result = _run(ladder, *command)
    _clean(result)
    assert result.exit_code == 3
    assert "reports/index.html is another page, expected the one that the reports give" in (
        result.output
    )
    assert json.loads(_run(ladder, *command, "--json").output.partition("\n]")[0] + "]")
    assert _run(ladder, "judge", "A").exit_code == 0
    assert _run(ladder, *command).exit_code == 0


@pytest.mark.parametrize("suffix", ["html", "md"])
@pytest.mark.parametrize("command", [("verify",), ("check", "--through", "A")])
def test_a_page_that_no_run_recorded_is_printed_again_and_compared(ladder, _run, command, suffix):
    """A forged page, and its entry taken out of the lock: nothing held it to anything."""
    assert _run(ladder, "judge", "A").exit_code == 0
    page = ladder / "reports" / f"gate_a.{suffix}"
    page.write_text(page.read_text().replace("PASS", "FAIL", 1))
    result = _run(ladder, *command)
    _clean(result)
    assert result.exit_code == 3
    assert f"reports/gate_a.{suffix} is another page" in result.output


def test_a_front_page_of_reports_that_are_gone_refuses(ladder, _run):
    assert _run(ladder, "judge", "A").exit_code == 0
    (ladder / "reports" / "gate_d.json").unlink()
    result = _run(ladder, "check", "--through", "A")
    assert result.exit_code == 3 and "index.html is another page" in result.output


def test_what_cannot_be_read_is_said_before_the_front_page(ladder, _run):
    assert _run(ladder, "judge", "A").exit_code == 0
    (ladder / "reports" / "gate_a.json").write_text("{")
    assert _run(ladder, "verify").exit_code == 2


def test_show_and_judge(ladder, _run):
    shown = _run(ladder, "show", "C")
    assert shown.exit_code == 0 and "Gate C: PASS" in shown.output
    result = _run(ladder, "judge", "A")
    assert result.exit_code == 0 and "Gate A: PASS" in result.output
    shown = _run(ladder, "show", "A", "--json")
    assert shown.exit_code == 0 and json.loads(shown.output)["gate"] == "A"


@pytest.mark.parametrize("verdict", ["PASS", "FAIL", "INCONCLUSIVE", "PENDING_REVIEW"])
@pytest.mark.parametrize("gate", "AE")
def test_a_verdict_has_its_colour_whichever_gate_is_shown(
    tmp_path, _run, monkeypatch, capsys, gate, verdict
):
    """Of Gate E as of the others: green passes, red does not, yellow waits or is not known."""
    number = {"PASS": 32, "FAIL": 31}.get(verdict, 33)
    answer = criterion(verdict, None, "nfe")
    report = REPORT.model_copy(update={"gate": gate, "verdict": verdict, "criteria": (answer,)})
    monkeypatch.setattr("gates.report.read_report", lambda root, gate: (report, "0123456789abcdef"))
    monkeypatch.setattr("gates.proof.judge", lambda root, gate, today: report)
    monkeypatch.setattr("gates.commands.require_beneath", lambda root: None)
    monkeypatch.setattr("gates.printed.coloured", lambda: True)
    shown = _run(tmp_path, "show", gate).output
    assert shown.startswith(f"Gate {gate}: \x1b[{number}m{verdict}\x1b[0m  (report")
    assert f"  \x1b[{number}m{verdict:<14}\x1b[0m nfe: " in shown
    run_program(card, "card", ["verify", "--root", str(tmp_path)])
    said = capsys.readouterr().out
    assert said.startswith(f"\x1b[{number}m{verdict}\x1b[0m: ")
    assert f"  \x1b[{number}m{verdict:<14}\x1b[0m nfe: " in said


def test_judge_exits_0_on_fail(ladder, _run):
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    result = _run(ladder, "judge", "A")
    assert result.exit_code == 0
    said = "Gate A: FAIL. lag_spread_rows: 4 action steps, required <= 1 action step\n"
    assert said in result.output


def test_verify_card_waits_for_people(ladder, capsys):
    def verified(*words):
        return run_program(card, "card", ["verify", *words, "--root", str(ladder)])

    assert verified() == 3
    said = capsys.readouterr().out
    assert said.startswith("PENDING_REVIEW: Wait for")
    assert "  PENDING_REVIEW signature_valid: waits for a person: sign the card\n" in said
    assert verified("--today", "soon") == 2


@pytest.mark.parametrize(
    ("args", "code"),
    [
        (("show", "X"), 2),
        (("judge", "A"), 2),
        (("show", "A"), 2),
        (("verify",), 3),
        (("sign", "--card", "c.json", "--key", "k", "--reviewer", "Eve"), 2),
    ],
)
def test_errors_are_one_sentence_with_their_exit_code(tmp_path, args, code, _run):
    result = _run(tmp_path, *args)
    _clean(result)
    assert result.exit_code == code
    assert len(result.output.strip().splitlines()) == 1


def test_a_bad_settings_file_is_exit_2(repo, _run):
    for text in ("gate_a: {limits: {x: 1}}", "gate_a: [", "gate_a: {a: 1, a: 2}", "x: 1"):
        (repo / "params.yaml").write_text(text)
        result = _run(repo, "judge", "A")
        _clean(result)
        assert result.exit_code == 2, text
        assert "params.yaml" in result.output


def test_a_plan_is_written_from_the_settings_beside_it(repo, _run):
    (repo / PREREGISTRATION).unlink()
    result = _run(repo, "preregister")
    assert result.exit_code == 0 and "Commit it before the evidence exists" in result.output
    assert (repo / PREREGISTRATION).read_bytes() == plan_bytes(read_params(repo))


def test_that_nothing_lies_here_is_said_before_simulation_is_loaded(tmp_path, _run, monkeypatch):
    monkeypatch.setitem(sys.modules, "gates.rederive", None)
    result = _run(tmp_path, "verify")
    assert result.exit_code == 3 and result.output.startswith("not built: make ladder")


@pytest.mark.parametrize(("command", "code"), [
    (("summary",), 0), (("check",), 3), (("verify",), 3),
])  # fmt: skip
@pytest.mark.parametrize("clone", [False, True])
def test_where_nothing_is_built_each_command_says_how_to_build(ladder, _run, command, code, clone):
    """A clone brings reports, and nothing that they could be proved from."""
    shutil.rmtree(ladder / "artifacts")
    if not clone:
        shutil.rmtree(ladder / "reports")
    result = _run(ladder, *command)
    assert result.exit_code == code
    assert result.output.startswith("not built: make ladder")
    assert ("without their evidence" in result.output) == clone
    assert "NOT JUDGED" not in result.output
