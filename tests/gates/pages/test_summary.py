"""The summary in Markdown."""

import html
import re
from pathlib import Path

import evidence
import pytest

from gates.pages.summary import markdown, plain
from gates.proof import judge


@pytest.mark.parametrize("text", ["a|b", "<b>", "@team", "`x`", "[l](u)", "two\nlines", "# h"])
def test_markdown_text_is_plain(text):
    out = plain(text)
    assert "\n" not in out and "<" not in out and "@" not in out
    assert not re.search(r"(?<!\\)[`|\[\]()#]", out.replace("&#64;", "").replace("&lt;", ""))


def _rows(lines: list[str]) -> list[list[str]]:
    """Cells of the rows of a table as a reader sees them, without its head."""
    found = []
    for line in lines:
        if line.startswith("| ") and not line.startswith("| verdict |"):
            cells = re.split(r"(?<!\\)\|", line)[1:-1]
            found.append([html.unescape(re.sub(r"\\(.)", r"\1", cell)).strip() for cell in cells])
    return found


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split() if re.fullmatch(r"[-+.e\d]+", word)]


def _as_printed(*values: float | None) -> list[float]:
    return [float(f"{value:.6g}") for value in values if value is not None]


def _says_what_the_report_says(row: list[str], c) -> None:
    verdict, name, candidate, measured, interval, required, owner = row
    assert verdict.split(" ", 1)[1].split(" (")[0] == c.verdict.replace("_", " ")
    assert (name, candidate, owner) == (c.id, c.candidate or "", c.owner or "nobody")
    assert _numbers(measured) == _as_printed(c.measured)
    assert _numbers(interval) == _as_printed(*(c.interval or ()))
    assert _numbers(required) == _as_printed(c.threshold)
    assert required[0] == {"<=": "≤", ">=": "≥"}[c.comparison] or c.threshold is None


def _holds_what_the_report_holds(report) -> None:
    lines = markdown(report).splitlines()
    word = report.verdict.replace("_", " ")
    assert re.fullmatch(rf"# Gate {report.gate}, .*: . {word}", lines[0])
    cut = next(n for n, line in enumerate(lines) if line.startswith("<details>"))
    unmet = [c for c in report.criteria if c.verdict != "PASS"]
    for rows, criteria in ((lines[:cut], unmet), (lines[cut:], report.criteria)):
        for row, c in zip(_rows(rows), criteria, strict=True):
            _says_what_the_report_says(row, c)
    assert lines[cut] == f"<details><summary>All {len(report.criteria)} criteria</summary>"
    assert sum(c.verdict == "PASS" for c in report.criteria) == int(
        re.search(r"Criteria:\*\* (\d+) of ", markdown(report))[1]
    )
    for name, verdict in report.candidates.items():
        said = [line for line in lines if line.startswith("- ") and f"**{plain(name)}**" in line]
        assert len(said) == 1 and f"**{plain(name)}** {verdict.replace('_', ' ')}" in said[0]


@pytest.mark.parametrize("gate", "ABCDE")
def test_the_summary_says_the_numbers_and_verdicts_of_the_report(judged, gate):
    _holds_what_the_report_holds(judged(gate))


def test_the_summary_of_what_fails_and_what_is_missing_says_so(copied: Path):
    evidence.edit_table(copied, "audit/clocks.parquet", evidence.lags_apart)
    evidence.replace(copied, "audit/strata.parquet", None)
    evidence.edit_table(
        copied,
        "stress/rollouts.parquet",
        lambda f: f.assign(interventions=f["interventions"].where(f["method"] != "flow", 1)),
    )
    for gate, verdicts in (("A", {"PASS", "FAIL", "INCONCLUSIVE"}), ("D", {"PASS", "FAIL"})):
        report = judge(copied, gate)
        assert {c.verdict for c in report.criteria} == verdicts
        _holds_what_the_report_holds(report)
