"""Markdown summary of a report, fit for a pull request; names cannot break out of the table.

Numbers are those of the HTML page, by the same functions: all digits stand in the JSON report.
"""

import re

from gates.doubt import texts_once
from gates.overrides import OVERRIDDEN, said
from gates.pages.numbers import judged_at, limit_said
from gates.pages.table import deciding, not_asked, overridden, passed_by, stops, tally, waived
from gates.readable import between, human, rests_on
from gates.report import NAMES, Answer, GateReport, report_path

SPECIAL = re.compile(r"([\\`*_\[\]()|#!~])")
PROOF = "genpolicy verify report"
MARKS = {"PASS": "✓", "FAIL": "✕", "INCONCLUSIVE": "?", "PENDING_REVIEW": "…"}
HEAD = (
    "| verdict | criterion | candidate | measured | rests on | judged at | required | owner |",
    "|---|---|---|---|---|---|---|---|",
)


def markdown(report: GateReport) -> str:
    """Verdict on top, then what decided it, the open criteria, all criteria, the caveats."""
    lines = [
        f"# Gate {report.gate}, {NAMES[report.gate]}: {MARKS[report.verdict]} "
        f"{plain(report.verdict.replace('_', ' '))}{f', {OVERRIDDEN}' * bool(report.overrides)}",
        "",
        *(line for one in report.overrides for line in (f"✕ **{plain(said(one))}**", "")),
        f"**Decision:** {plain(report.decision)}",
        "",
    ]
    if decided := deciding(report) or passed_by(report):
        lines += [f"**Decided by:** {plain(decided)}", ""]
    if report.diagnosis:
        label = "Diagnosis" if report.verdict == "PASS" else "Look first at"
        lines += [f"**{label}:** {plain(report.diagnosis)}", ""]
    lines += [f"**Criteria:** {plain(tally(report))}.", ""]
    if unasked := not_asked(report):
        lines += [f"**Not asked:** {plain(' '.join(unasked))}", ""]
    lines += _candidates(report)
    unmet = [c for c in report.criteria if c.verdict != "PASS"]
    if unmet:
        lines += ["## Not met", "", *HEAD, *(_row(c, report) for c in unmet), ""]
    rows = [_row(criterion, report) for criterion in report.criteria]
    lines += [f"<details><summary>All {len(rows)} criteria</summary>", "", *HEAD, *rows, ""]
    lines += ["</details>", "", "## Caveats", ""]
    caveats = texts_once(report.caveats, report.candidates)
    lines += [f"- {plain(caveat)}" for caveat in caveats]
    page = report_path(report.gate).removesuffix(".json")
    lines += ["", f"Figures: `{page}.html`. All numbers: `{page}.json`. Proof: `{PROOF}`."]
    return "\n".join(lines) + "\n"


def _candidates(report: GateReport) -> list[str]:
    if not report.candidates:
        return []
    why = stops(report)
    lines = []
    for name, verdict in sorted(report.candidates.items()):
        reason = f", {plain(why[name])}" if why[name] else ""
        text = plain(verdict.replace("_", " "))
        lines.append(f"- {MARKS[verdict]} **{plain(name)}** {text}{reason}")
    return [*lines, ""]


def _row(c: Answer, report: GateReport) -> str:
    pending = c.verdict == "PENDING_REVIEW" and c.measured is None
    where = judged_at(c)
    aside = waived(c, report) or overridden(c, report)
    note = f" ({aside})" if aside else ""
    cells = (
        f"{MARKS[c.verdict]} {c.verdict.replace('_', ' ')}{note}",
        c.id,
        c.candidate or "",
        "pending review" if pending else human(c, c.measured),
        rests_on(c.counted),
        f"{where} of {between(c)}" if where and c.interval else where,
        limit_said(c) if c.threshold is not None else "a limit in params.yaml",
        c.owner or "nobody",
    )
    return "| " + " | ".join(plain(cell) for cell in cells) + " |"


def plain(text: str) -> str:
    """Text that Markdown shows as it is: no markup, no HTML, no mention, one line."""
    one_line = " ".join(text.split())
    escaped = SPECIAL.sub(r"\\\1", one_line)
    return (
        escaped.replace("&", "&amp;")
        .replace("<", "&lt;")
        .replace(">", "&gt;")
        .replace("@", "&#64;")
    )
