"""The workflows that are handed out: each command of ours in them runs, is green and is red."""

import re
import shlex
import xml.etree.ElementTree as ET
from pathlib import Path

import evidence
import pytest
import yaml

from gates.commands import gates
from gates.pages.summary import markdown
from gates.report import read_report, report_path
from gates.run_commands import report
from genpolicy.cli.shell import run_program

FILES = Path(__file__).parents[2] / "docs" / "ci"
APPS = {"gates": gates, "report": report}
LAYOUTS = {"github": "github", "gitlab": "junit"}


def ours(name):
    """Words of each genpolicy command of a workflow, as a shell would split them."""
    text = (FILES / f"{name}.yml").read_text()
    lines = re.findall(r"\.venv/bin/genpolicy ([^>\n]+)", text)
    return [[word for word in shlex.split(line) if word != "'"] for line in lines]


def check_of(name):
    """The words of `gates check`, after the group."""
    (words,) = [words[1:] for words in ours(name) if words[:2] == ["gates", "check"]]
    return words


@pytest.fixture
def _run(ladder, monkeypatch, capsys):
    monkeypatch.chdir(ladder)

    def run(words):
        code = run_program(gates, "gates", words)
        return code, capsys.readouterr().out

    return run


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_workflow_is_yaml_and_asks_for_the_whole_history(name):
    text = (FILES / f"{name}.yml").read_text()
    assert isinstance(yaml.safe_load(text), dict)
    assert re.search(r"fetch-depth: 0|GIT_DEPTH: \"0\"", text)
    assert ["verify", "report"] in ours(name)
    assert LAYOUTS[name] in check_of(name)


def test_the_check_of_both_is_green_on_a_ladder_that_passes_and_red_on_one_that_does_not(
    ladder, _run
):
    code, text = _run(check_of("github"))
    assert (code, text.strip()) == (0, "")
    code, text = _run(check_of("gitlab"))
    root = ET.fromstring(text)
    assert code == 0 and not root.findall(".//failure")
    assert [suite.get("name") for suite in root] == ["Gate A", "Gate B", "Gate C", "Gate D"]
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    _run(["judge", "A"])
    code, text = _run(check_of("gitlab"))
    red = {test.get("name") for test in ET.fromstring(text).findall(".//testcase[failure]")}
    assert code == 3 and red == {"lag_spread_rows", "report"}, "the gates above stand on another"
    assert "chunking_valid_share" not in red
    code, text = _run(check_of("github"))
    assert code == 3 and "::error file=reports/gate_a.json,title=Gate A%2C lag_spread_rows" in text


def test_a_page_of_another_ladder_is_red_in_the_list_too(ladder, _run):
    (ladder / "reports" / "index.html").write_text("<p>all is well</p>")
    code, text = _run(check_of("gitlab"))
    (failure,) = ET.fromstring(text).findall(".//failure")
    assert code == 3 and "index.html is another page" in failure.get("message")


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_workflow_shows_the_markdown_of_every_gate_that_was_judged(ladder, name):
    """Also where a step before it is red: that is when somebody reads it."""
    workflow = yaml.safe_load((FILES / f"{name}.yml").read_text())
    if name == "github":
        (step,) = [s for s in workflow["jobs"]["gates"]["steps"] if "gate_*.md" in s.get("run", "")]
        assert step["if"] == "always()" and step["run"].strip().endswith(
            '>> "$GITHUB_STEP_SUMMARY"'
        )
        said = step["run"]
        assert said.index("gate_*.md") < said.index("report diff"), "which may have nothing to say"
    else:
        said = "\n".join(workflow["gates"]["after_script"])  # runs whatever the script did
    (pattern,) = re.findall(r"^\s*cat (\S+)", said, re.MULTILINE)
    for gate in "ABCD":
        page = (ladder / report_path(gate)).with_suffix(".md")
        page.write_text(markdown(read_report(ladder, gate)[0]))
    shown = {path.name for path in ladder.glob(pattern)}
    assert shown == {f"gate_{gate}.md" for gate in "abcd"}
    assert all((ladder / f"reports/{file}").read_text().startswith("# Gate ") for file in shown)


def test_the_difference_that_is_shown_runs(ladder, monkeypatch, capsys):
    monkeypatch.chdir(ladder)
    (words,) = [words for words in ours("github") if words[0] == "report"]
    assert words[:4] == ["report", "diff", "origin/$GITHUB_BASE_REF", "reports"]
    said = (FILES / "github.yml").read_text()
    assert f"{words[3]} 2>&1 ||" in said, "a branch without reports makes no job red"
    assert run_program(report, "genpolicy report", ["diff", "reports", "reports"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "A  need: PASS, the same"
    assert run_program(report, "genpolicy report", ["diff", "nowhere", "reports"]) == 2
    assert "no folder and no revision" in capsys.readouterr().err
