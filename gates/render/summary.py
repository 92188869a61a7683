"""Markdown summary of a report, fit for a pull request; names cannot break out of the table."""

import re

from gates.chain import limit_text, measured_text
from gates.ladder import NAMES, decided_text
from gates.models import Criterion, GateReport, report_path

SPECIAL = re.compile(r"([\\`*_\[\]()|#!~])")


def markdown(report: GateReport) -> str:
    """Verdict on top, then what decided it, the criteria and the caveats."""
    lines = [
        f"# Gate {report.gate}, {NAMES[report.gate]}: {plain(report.verdict)}",
        "",
        f"**Decision:** {plain(report.decision)}",
        "",
    ]
    if decided := decided_text(report):
        lines += [f"**Decided by:** {plain(decided)}", ""]
    if report.diagnosis:
        lines += [f"**Look first at:** {plain(report.diagnosis)}", ""]
    for name, verdict in sorted(report.candidates.items()):
        lines.append(f"- {plain(name)}: {plain(verdict)}")
    lines += ["", "| criterion | candidate | measured | interval | required | verdict | owner |"]
    lines.append("|---|---|---|---|---|---|---|")
    lines += [_row(criterion) for criterion in report.criteria]
    lines += ["", "Caveats:", ""]
    lines += [f"- {plain(caveat)}" for caveat in report.caveats]
    lines += [
        "",
        f"Re-derive: `python -m gates verify`; full report: `{report_path(report.gate)}`.",
    ]
    return "\n".join(lines) + "\n"


def _row(c: Criterion) -> str:
    interval = f"{c.interval[0]:.6g} to {c.interval[1]:.6g}" if c.interval else ""
    measured = f"{c.measured:.6g}" if c.measured is not None else measured_text(c)
    cells = (
        c.id,
        c.candidate or "",
        measured,
        interval,
        limit_text(c),
        c.verdict,
        c.owner,
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
