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


UNITS = {"ms": 1e-3, "mm": 1e-3, "%": 1e-2}
SIGNS = {"<=": "≤ ", ">=": "≥ "}


def _read(text: str) -> tuple[float, str]:
    """A number as it is printed, in SI units, and its digits."""
    found = re.fullmatch(r"×?(-?[\d,.]+(?:e[-+]\d+)?)(?: (.+))?", text)
    assert found, text
    return float(found[1].replace(",", "")) * UNITS.get(found[2], 1.0), found[1]


def _is_printed(text: str, value: float) -> None:
    """It is that number, to three digits that count unless it is whole."""
    read, digits = _read(text)
    assert read == pytest.approx(value, rel=0.0051, abs=1e-12)
    counting = re.sub(r"e.*|[-,.]", "", digits).lstrip("0")
    assert value == int(value) or len(counting) <= 3 or abs(read) >= 1000, text


def _says_what_the_report_says(row: list[str], c) -> None:
    verdict, name, candidate, measured, counted, judged, required, owner = row
    assert verdict.split(" ", 1)[1].split(" (")[0] == c.verdict.replace("_", " ")
    assert (name, candidate, owner) == (c.id, c.candidate or "", c.owner or "nobody")
    if c.measured is None:
        assert (measured, judged) == (
            "pending review" if c.verdict == "PENDING_REVIEW" else "not measured",
            "",
        )
    else:
        _is_printed(measured, c.measured)
        where, _, interval = judged.partition(" of ")
        assert where in ("a point", "the worse end", "the better end", "a point of its interval")
        assert (where == "a point") == (c.interval is None) == (interval == "")
        low, high = interval.split(" to ") if interval and " to 1 to " not in interval else ("", "")
        for text, end in zip((low, high), c.interval or (), strict=False):
            unit = high.partition(" ")[2]
            _is_printed(text if not unit or " " in text else f"{text} {unit}", end)
    assert counted == re.sub(
        r"\d{4,}", lambda n: f"{int(n[0]):,}", re.sub("^0 of ", "none of ", c.counted)
    )
    if c.threshold is None:
        assert required == "a limit in params.yaml"
    else:
        assert required.startswith(SIGNS[c.comparison])
        _is_printed(required[2:], c.threshold)


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


def test_a_number_is_the_same_on_the_page_and_in_the_summary(judged):
    """Milliseconds, millimetres and percent are what both print."""
    from gates.pages.numbers import limit_said
    from gates.readable import human

    seen = set()
    for gate in "ABCD":
        report = judged(gate)
        lines = markdown(report).splitlines()
        cut = next(n for n, line in enumerate(lines) if line.startswith("<details>"))
        for row, c in zip(_rows(lines[cut:]), report.criteria, strict=True):
            if c.measured is not None:
                assert row[3] == human(c, c.measured) and row[6] == limit_said(c)
                seen.add(row[6].rpartition(" ")[2])
    assert {"ms", "mm", "%"} <= seen
