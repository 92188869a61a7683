"""The end of the desk: commands, hashes, settings and words, for those who check or repeat it."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from gates.pages.figures import Table
from gates.pages.guide import label
from gates.report import GATES, Gate, GateReport, report_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes

GLOSSARY = "glossary.md"
COMMANDS = (
    ("genpolicy verify report", "hash everything, judge again, print every page and row again"),
    ("genpolicy report status", "when this ran, at which commit, whether it is proved now"),
    ("genpolicy report diff HEAD~1 reports", "what moved since a commit, and what may be why"),
    ("genpolicy gates judge D", "judge the evidence that lies here once more, any gate"),
    ("genpolicy export rollout METHOD/CONDITION/START --to foxglove --out watch.mcap",
     "open a rollout of Gate D, by the name in its row; also --to gif, --to rerun"),
    ("genpolicy package METHOD", "all of a candidate's evidence as one file that proves itself"),
)  # fmt: skip
"""What a reviewer may want to run, and what it does."""
MARKED = re.compile(r"`([^`]*)`")


@dataclass(frozen=True)
class End:
    """What stands at the end of the desk.

    Attributes:
        commands: Each with what it does.
        hashes: A row a gate: its report, and what it rests on by kind. Heads first.
        settings: Gate, name and value of each setting that is one value or a list of such.
        words: Of the glossary, each with its meaning.
    """

    commands: tuple[tuple[str, str], ...]
    hashes: Table
    settings: Table
    words: tuple[tuple[str, str], ...]


def end_of(reports: Mapping[Gate, GateReport]) -> End:
    """The end of the desk, from the reports that lie there."""
    present = [reports[gate] for gate in GATES if gate in reports]
    return End(
        COMMANDS,
        (
            ("gate", "report", "evidence", "code", "parameters", "recorded runs", "settings"),
            *(_hashes(report) for report in present),
        ),
        (("gate", "setting", "value"), *(row for report in present for row in _settings(report))),
        tuple(glossary()),
    )


def _hashes(report: GateReport) -> tuple[str, ...]:
    return (
        report.gate,
        sha256_bytes(report_bytes(report)),
        f"{len(report.materials):,} files: {_digest(report.materials)}",
        _digest(report.code),
        _digest(report.parameters),
        _digest(report.pipeline),
        _digest(report.settings),
    )


def _digest(content: Mapping[str, Any]) -> str:
    """SHA-256 of what the report holds under one key, written as the report is."""
    return sha256_bytes(canonical_json(dict(content)))


def _settings(report: GateReport) -> Iterator[tuple[str, ...]]:
    for name, value in sorted(report.settings.items()):
        members = value if isinstance(value, list) else [value]
        if members and not any(isinstance(member, dict | list) for member in members):
            yield report.gate, label(name), ", ".join(map(_said, members))


def _said(value: Any) -> str:
    """A value as a reader takes it in."""
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def glossary() -> Iterator[tuple[str, str]]:
    """Words and their meanings, from the one file that holds them."""
    text = (files("gates.pages") / GLOSSARY).read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ", 1) for line in text.splitlines() if line[:2] == "| "]
    for word, meaning in rows[1:]:
        yield word, MARKED.sub(r"\1", meaning)
