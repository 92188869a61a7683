"""The evidence on the desk: one figure and one table a gate; the rest stands on its page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from textwrap import shorten

from gates.evidence import Evidence, MissingEvidenceError, counts, flags
from gates.feasibility.settings import CANDIDATES, HELD_OUT, INTACT, PASSED
from gates.need.settings import AUDIT
from gates.pages import plots_feasibility, plots_need, plots_stress, plots_time
from gates.pages.bound import require_bound
from gates.pages.desk_card import Signing
from gates.pages.desk_costs import share
from gates.pages.figures import Listing, Picturable, Shown, Table, draw_all, in_order
from gates.pages.plots_time import TEMPERATURES
from gates.pages.rows import Rows
from gates.pages.rows_files import RowsFile
from gates.report import GATES, NAMES, Gate, GateReport, parse_report, report_bytes, report_path
from gates.reproducibility.latency_budget import LATENCY, MILLI, budget_of
from gates.stress.rollouts import ROLLOUTS
from genpolicy.audit.rows import ModeOutcome
from genpolicy.errors import GenpolicyError
from genpolicy.evidence.rows.reproducibility import LatencyRow
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.rows.stress import RolloutRow

MODES = f"{AUDIT}/modes.parquet"
UNBROKEN = "\u00a0"
"""A space at which no line ends, so that a share and its counts stay readable in a narrow cell."""
UNREADABLE = "no report that can be read"
NOT_JUDGED = "this gate was not judged"
MOST = 200
"""Characters of a reason; the gate's page has all of it."""
KEPT = 16
"""The desk is printed again by every gate; the same evidence is drawn once in a process."""


@dataclass(frozen=True)
class Exhibit:
    """What the desk shows of one gate's evidence.

    Attributes:
        gate: Its letter.
        name: Its name.
        figure: The figure; None for a gate that has none.
        table: The table, or why it is not shown.
        rows: Files of rows that both are made of.
        missing: Why nothing is shown; empty if something is.
    """

    gate: Gate
    name: str
    figure: Shown | None = None
    table: Shown | None = None
    rows: tuple[RowsFile, ...] = ()
    missing: str = ""


def exhibits_of(
    reports: Mapping[Gate, GateReport],
    evidence: Evidence,
    signing: Signing,
    rows: Mapping[Gate, Rows],
) -> tuple[Exhibit, ...]:
    """The evidence of every gate, from what its report names, and the rows under it."""
    return tuple(_exhibit(gate, reports.get(gate), evidence, signing, rows) for gate in GATES)


def _exhibit(
    gate: Gate,
    report: GateReport | None,
    evidence: Evidence,
    signing: Signing,
    rows: Mapping[Gate, Rows],
) -> Exhibit:
    if report is None:
        there = (evidence.root / report_path(gate)).is_file()
        return Exhibit(gate, NAMES[gate], missing=UNREADABLE if there else NOT_JUDGED)
    if gate == "E":
        return _signatures(signing)
    sources = dict.fromkeys(path for item in SHOWN[gate] for path in (item.source, *item.also))
    try:
        for path in sources:
            require_bound(evidence, report, path)
    except (MissingEvidenceError, GenpolicyError) as error:
        return Exhibit(gate, NAMES[gate], missing=shorten(str(error), MOST, placeholder=" …"))
    figure, table = _drawn(_Judged(gate, report_bytes(report), evidence.root))
    own = tuple(file for file in rows[gate].files if file.path in sources)
    return Exhibit(gate, NAMES[gate], figure, table, own)


@dataclass(frozen=True)
class _Judged:
    """Evidence as a report names it, by hash; it is the same wherever it lies.

    Attributes:
        gate: Letter.
        report: Bytes of the report.
        root: Below which its evidence lies, and was found to be what the report names.
    """

    gate: Gate
    report: bytes
    root: Path = field(compare=False)


@lru_cache(maxsize=KEPT)
def _drawn(judged: _Judged) -> tuple[Shown, ...]:
    """Figure and table of the evidence that a report names."""
    report = parse_report(judged.report, gate=judged.gate)
    return tuple(draw_all(SHOWN[judged.gate], Evidence(judged.root), report))


def _signatures(signing: Signing) -> Exhibit:
    if signing.missing:
        return Exhibit("E", NAMES["E"], missing=signing.missing)
    lines = [
        *((person, "has signed") for person in signing.signed),
        *((role, "has not signed") for role in signing.lacking),
    ]
    table = Shown("Who has to sign", "", (), listed=(("who", "signature"), *lines))
    return Exhibit("E", NAMES["E"], table=table)


def _named(plots: Sequence[Picturable], title: str) -> Picturable:
    """A figure of a gate's page by its title."""
    return next(plot for plot in plots if plot.title == title)


def _modes(evidence: Evidence, report: GateReport) -> Table:
    """Of each mode how many of its episodes succeed, and how many of its chunks are feasible."""
    frame = evidence.rows(MODES, ModeOutcome).sort_values(["phase", "mode"])
    columns = ("successes", "episodes", "admissible", "checked")
    lines = [
        (str(mode), str(phase), _share(won, of), _share(passed, checked))
        for mode, phase, won, of, passed, checked in zip(
            frame["mode"], frame["phase"], *(counts(frame, name) for name in columns), strict=True
        )
    ]
    return ("mode", "phase", "episodes", "chunks"), *lines


def _ends(evidence: Evidence, report: GateReport) -> Table:
    """Warm and cold latency of each candidate, end to end; the terms stand on the gate's page."""
    frame, confidence = evidence.rows(LATENCY, LatencyRow), float(report.settings["confidence"])
    lines = []
    for method in in_order(report.candidates):
        own = frame[frame["method"] == method]
        ends = [budget_of(own, name, confidence=confidence).end_to_end for name in TEMPERATURES]
        cells = [f"{MILLI * value:.3g} ms" for end in ends for value in (end.p50[0], end.p95[0])]
        lines.append((method, *cells))
    return ("candidate", *(f"{t} {q}" for t in TEMPERATURES for q in ("p50", "p95"))), *lines


def _layers(evidence: Evidence, report: GateReport) -> Table:
    """Of each method what passes all six layers, of intact and of corrupted observations."""
    frame = evidence.rows(CANDIDATES, CandidateRow)
    lines = []
    for method in in_order(frame["method"]):
        rows = frame[frame["method"] == method]
        held, corrupted = rows[rows["fixture"] == HELD_OUT], rows[~rows["fixture"].isin(INTACT)]
        cells = [_share((own["outcome"] == PASSED).sum(), len(own)) for own in (held, corrupted)]
        lines.append((method, *cells))
    return ("method", "held out", "corrupted"), *lines


def _successes(evidence: Evidence, report: GateReport) -> Table:
    """Success of each method in each judged condition; what it costs has all of them together."""
    frame = evidence.rows(ROLLOUTS, RolloutRow)
    planned = [str(name) for name in report.settings["perturbations"]]
    frame = frame[frame["perturbation"].isin(planned)]
    lines = []
    for method in in_order(frame["method"]):
        own = frame[frame["method"] == method]
        parts = [own[own["perturbation"] == name] for name in planned]
        lines.append((method, *(_share(flags(rows, "success").sum(), len(rows)) for rows in parts)))
    return ("method", *(name.replace("_", " ") for name in planned)), *lines


def _share(hits: float, of: float) -> str:
    cell = share(hits, of)
    parts = [cell.value, *([cell.of] if cell.of else [])]
    return ", ".join(part.replace(" ", UNBROKEN) for part in parts)


SHOWN: dict[Gate, tuple[Picturable, Picturable]] = {
    "A": (
        _named(plots_need.PLOTS, "Modes and their mean, in the scene plane"),
        Listing("Episodes that succeed, and chunks that pass all six layers", "", MODES, _modes),
    ),
    "B": (
        _named(plots_time.PLOTS, "Where the time goes"),
        Listing("From sensor to answer, end to end", "", LATENCY, _ends),
    ),
    "C": (
        _named(plots_feasibility.PLOTS, "Rejection waterfall"),
        Listing("Chunks that pass all six layers", "", CANDIDATES, _layers),
    ),
    "D": (
        _named(plots_stress.PLOTS, "How rollouts end"),
        Listing("Success, by condition and method", "", ROLLOUTS, _successes),
    ),
}
"""Figure and table of each gate with measured evidence."""
