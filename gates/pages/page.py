"""HTML pages: one self-contained file per gate, and the ladder's front page.

Autoescape is on and nothing from data is marked safe; the only markup passed in are the figures
drawn here, and `<code>` around what a sentence has between backticks. Numbers stand as
`<data value="...">` with the JSON number, so that a test can read them back.
"""

import dataclasses
import functools
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from gates.doubt import texts_once
from gates.evidence import Evidence, MissingEvidenceError
from gates.overrides import said
from gates.pages import (
    plots_convergence,
    plots_density,
    plots_feasibility,
    plots_front,
    plots_incidents,
    plots_need,
    plots_rejected,
    plots_stress,
    plots_time,
    tables_clocks,
    tables_compute,
    tables_faults,
    tables_feasibility,
    tables_holds,
    tables_machine,
    tables_margins,
    tables_matching,
    tables_monitors,
    tables_overruns,
    tables_recovery,
    tables_searched,
    tables_severity,
    tables_stress,
    tables_survival,
    tables_trainings,
    tables_variations,
)
from gates.pages.card_shown import card_shown
from gates.pages.clips import clips_of
from gates.pages.desk import UNREADABLE, desk_of, headline
from gates.pages.desk_card import card_of, papers_of, signing_of
from gates.pages.desk_costs import HEADS, costs_of
from gates.pages.desk_end import end_of
from gates.pages.desk_gain import gain_of
from gates.pages.desk_gates import exhibits_of
from gates.pages.desk_line import line_of
from gates.pages.figures import Picturable, Table, draw_all
from gates.pages.guide import BACK_TO, QUESTIONS, READING, words
from gates.pages.numbers import at_its_end, judged_at, limit_said, recounted
from gates.pages.rows import CRITERIA, Rows, rows_of
from gates.pages.table import columns, deciding, groups, not_asked, passed_by, stops, tally
from gates.readable import human
from gates.report import GATES, NAMES, Gate, GateReport, read_report, report_bytes
from gates.reproducibility.settings import RELOAD
from gates.stress.rollouts import ROLLOUTS
from gates.words import HASH, SHOWN_HASH
from genpolicy.errors import IntegrityError
from genpolicy.evidence.documents.reproducibility import CANDIDATES, IdentityCard
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.pages.style import page_style

CODE = re.compile(r"`([^`\n]+)`")
"""In a sentence: a command, a file or a name, as it is typed."""
MARKS = {
    "PASS": "✓",
    "FAIL": "✕",
    "INCONCLUSIVE": "?",
    "PENDING_REVIEW": "…",
    "NOT JUDGED": "·",
    UNREADABLE: "✕",
}
PLOTS: dict[str, tuple[Picturable, ...]] = {
    "A": plots_need.PLOTS,
    "B": (
        tables_variations.LISTING,
        *plots_convergence.PLOTS,
        tables_matching.RULES,
        tables_compute.LISTING,
        *plots_time.PLOTS,
        tables_overruns.DECLARED,
        tables_machine.BESIDE,
        *plots_front.PLOTS,
        *plots_density.PLOTS,
    ),
    "C": (
        *plots_feasibility.PLOTS,
        *tables_feasibility.LISTINGS,
        *tables_margins.LISTINGS,
        *tables_survival.LISTINGS,
        *plots_rejected.GALLERIES,
        *plots_incidents.PLOTS,
        *tables_holds.LISTINGS,
    ),
    "D": (
        *plots_stress.PLOTS,
        *tables_recovery.LISTINGS,
        tables_severity.CURVE,
        tables_severity.HALF,
        tables_clocks.CLOCKS,
        tables_monitors.WATCHED,
        tables_overruns.DONE,
        tables_faults.FAILED,
        *tables_stress.LISTINGS,
        *tables_trainings.LISTINGS,
    ),
    "E": (tables_searched.FOUND,),
}


def exact(value: float) -> str:
    """A number as JSON writes it."""
    return json.dumps(value)


def gate_page(root: Path, report: GateReport, *, rows: Rows | None = None) -> str:
    """HTML of one gate's report; figures are drawn from the evidence below `root`.

    Args:
        root: Below which evidence lies.
        report: The report.
        rows: Files of rows that are printed beside it; read below `root` where none are given.
    """
    state, card, signing = card_shown(root, report)
    return _render(
        "gate.html",
        current=report.gate,
        report=report,
        name=NAMES[report.gate],
        question=QUESTIONS[report.gate],
        decided=deciding(report) or passed_by(report),
        tally=tally(report),
        not_asked=not_asked(report),
        stops=stops(report),
        groups=groups(report),
        columns=columns(report),
        reading=READING[report.gate],
        words=words(report.gate),
        caveats=texts_once(report.caveats, report.candidates),
        pictures=draw_all(PLOTS[report.gate], Evidence(root), report),
        identities=identities(Evidence(root), report),
        card=card,
        card_state=state,
        signing=signing,
        overridden=[said(entry) for entry in report.overrides],
        rows=rows or rows_of(root, report),
        rows_of_criteria=CRITERIA,
        digest=sha256_bytes(report_bytes(report)),
    )


@dataclass(frozen=True)
class Identities:
    """The identity cards of Gate B's candidates.

    Attributes:
        differ: Heads, then the items in which they differ, a column each.
        shared: The items that are the same for all.
    """

    differ: Table
    shared: Table


def identities(evidence: Evidence, report: GateReport) -> Identities | None:
    """The cards side by side; None for the other gates, and where none can be read."""
    if report.gate != "B":
        return None
    try:
        known = evidence.document(RELOAD, CANDIDATES)
    except MissingEvidenceError:
        return None
    names = [name for name in report.candidates if name in known]
    rows = {
        _item(item.name): tuple(_said(getattr(known[name].card, item.name)) for name in names)
        for item in dataclasses.fields(IdentityCard)
    }
    rows = {"checkpoint": tuple(_said(known[name].checkpoint) for name in names), **rows}
    differ = tuple((key, *said) for key, said in rows.items() if len(set(said)) > 1)
    shared = tuple((key, said[0]) for key, said in rows.items() if len(set(said)) == 1)
    return Identities((("", *names), *differ), shared)


def _item(name: str) -> str:
    """An item of the card as a reader writes it, its unit behind a comma."""
    for suffix, unit in (("_hz", "Hz"), ("_s", "s")):
        if name.endswith(suffix):
            return f"{name.removesuffix(suffix).replace('_', ' ')}, {unit}"
    return name.replace("_sha256", " by hash").replace("_", " ")


def _said(value: Any) -> str:
    """An item as a reader takes it in: a hash by its beginning, a list by its members."""
    if value is None:
        return "none: the sampler has none"
    if isinstance(value, list):
        return ", ".join(map(_said, value))
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return f"{text[:SHOWN_HASH]}…" if HASH.fullmatch(text) else text


def index_page(root: Path) -> str:
    """HTML of the ladder, from the reports as they lie there."""
    rows = [_row(root, gate) for gate in GATES]
    reports = {row["gate"]: row["report"] for row in rows if row["report"] is not None}
    unreadable = {row["gate"]: row["decision"] for row in rows if row["verdict"] == UNREADABLE}
    evidence = Evidence(root)
    papers = papers_of(reports, evidence)
    rows_by_gate = {gate: rows_of(root, report) for gate, report in reports.items()}
    signing = signing_of(reports, evidence, papers, rows_by_gate.get("D"))
    return _render(
        "index.html",
        current="",
        ladder=rows,
        desk=(desk := desk_of(reports, signing.pending, unreadable)),
        headlines={gate: headline(report, desk.about) for gate, report in reports.items()},
        overridden=list(dict.fromkeys(said(e) for r in reports.values() for e in r.overrides)),
        line=line_of(reports, evidence, card_of(papers)),
        gain=gain_of(reports, evidence),
        clips=clips_of(reports, evidence),
        heads=HEADS,
        costs=costs_of(reports, evidence),
        rows=rows_by_gate,
        rows_of_criteria=CRITERIA,
        rollouts=rows_by_gate["D"].by_method(ROLLOUTS) if "D" in reports else {},
        exhibits=exhibits_of(reports, evidence, signing, rows_by_gate),
        signing=signing,
        end=end_of(reports),
    )


def _row(root: Path, gate: Gate) -> dict[str, Any]:
    row: dict[str, Any] = {
        "gate": gate,
        "name": NAMES[gate],
        "question": QUESTIONS[gate],
        "back_to": BACK_TO[gate],
        "candidates": {},
        "stops": {},
        "tally": "",
        "decided": "",
        "decision": "",
        "report": None,
        "verdict": "NOT JUDGED",
    }
    if not (root / f"reports/gate_{gate.lower()}.json").is_file():
        return row
    try:
        report, _ = read_report(root, gate)
    except IntegrityError as error:
        return {**row, "verdict": UNREADABLE, "decision": str(error)}
    row.update(
        verdict=report.verdict,
        decided=deciding(report) or passed_by(report),
        candidates=report.candidates,
        stops=stops(report),
        tally=tally(report),
        decision=report.decision,
        report=report,
    )
    return row


@functools.cache
def _environment() -> Environment:
    """Templates, each compiled once in a process."""
    found = Environment(
        loader=PackageLoader("gates.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters["coded"] = coded
    return found


def coded(text: str) -> Markup:
    """A sentence with what stands between backticks as code; all of it is escaped first."""
    return Markup(CODE.sub(r"<code>\1</code>", str(escape(text))))


def _render(template: str, **values: Any) -> str:
    page = _environment().get_template(template)
    return page.render(
        style=page_style(),
        gates=GATES,
        marks=MARKS,
        exact=exact,
        human=human,
        judged_at=judged_at,
        limit_said=limit_said,
        at_its_end=at_its_end,
        recounted=recounted,
        plain=lambda value: json.dumps(value, ensure_ascii=False),
        **values,
    )
