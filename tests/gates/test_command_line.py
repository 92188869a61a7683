"""The command line: exit codes, one-sentence errors, no traceback."""

import json

import evidence
import pytest
from typer.testing import CliRunner

from gates.__main__ import app
from gates.proof import STAGE_REQUIRES

RUN = CliRunner()


def _run(root, *args):
    return RUN.invoke(app, [*args, "--root", str(root)])


def _clean(result):
    assert "Traceback" not in result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)


def test_check_passes_through_d_and_not_through_e(ladder):
    assert _run(ladder, "check").exit_code == 0
    result = _run(ladder, "check", "--through", "E")
    assert result.exit_code == 1
    assert "NOT JUDGED" in result.output


def test_summary_prints_one_line_per_stage_and_exits_0(ladder):
    result = _run(ladder, "summary")
    assert result.exit_code == 0
    stages = [line.split()[0] for line in result.output.splitlines()[1 : 1 + len(STAGE_REQUIRES)]]
    assert stages == list(STAGE_REQUIRES)
    assert "reports/index.html" not in result.output, "a page that is not there is not announced"
    (ladder / "reports" / "index.html").write_text("")
    assert "reports/index.html" in _run(ladder, "summary").output
    rows = json.loads(_run(ladder, "summary", "--json").output)
    verdicts = {row["stage"]: row["verdict"] for row in rows}
    assert [verdicts[f"gate_{letter}"] for letter in "abcd"] == ["PASS"] * 4


def test_verify_finds_a_changed_byte(ladder):
    assert _run(ladder, "verify").exit_code == 0
    file = ladder / "artifacts/reload/identity.json"
    file.write_bytes(file.read_bytes() + b" ")
    result = _run(ladder, "verify")
    _clean(result)
    assert result.exit_code == 3
    assert "identity.json" in result.output


def test_show_and_judge(ladder):
    assert "Gate C: PASS" in _run(ladder, "show", "C").output
    result = _run(ladder, "judge", "A")
    assert result.exit_code == 0 and "Gate A: PASS" in result.output
    assert json.loads(_run(ladder, "show", "A", "--json").output)["gate"] == "A"


def test_judge_exits_0_on_fail(ladder):
    evidence.edit_table(ladder, "audit/clocks.parquet", lambda f: f.assign(offset_after_s=0.5))
    result = _run(ladder, "judge", "A")
    assert result.exit_code == 0
    assert "Gate A: FAIL. clock_residual_s: 0.5, required <= 0.01" in result.output


def test_verify_card_waits_for_people(ladder):
    result = _run(ladder, "verify-card")
    assert result.exit_code == 3
    assert "PENDING_REVIEW" in result.output
    assert _run(ladder, "verify-card", "--today", "soon").exit_code == 2


@pytest.mark.parametrize(
    ("args", "code"),
    [
        (("show", "X"), 2),
        (("judge", "A"), 2),
        (("show", "A"), 2),
        (("verify",), 3),
        (("sign", "--card", "c.json", "--key", "k", "--reviewer", "Eve"), 3),
    ],
)
def test_errors_are_one_sentence_with_their_exit_code(tmp_path, args, code):
    result = _run(tmp_path, *args)
    _clean(result)
    assert result.exit_code == code
    assert len(result.output.strip().splitlines()) == 1


def test_a_bad_settings_file_is_exit_2(repo):
    for text in ("gate_a: {limits: {x: 1}}", "gate_a: [", "gate_a: {a: 1, a: 2}", "x: 1"):
        (repo / "params.yaml").write_text(text)
        result = _run(repo, "judge", "A")
        _clean(result)
        assert result.exit_code == 2, text
        assert "params.yaml" in result.output
