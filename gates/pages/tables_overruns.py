"""Tables of latency terms that take too long: what is declared (Gate B), what was done (Gate D)."""

import math

from gates.evidence import Evidence, numbers
from gates.pages.bound import require_bound
from gates.pages.figures import Folded, Listing, Table, in_order
from gates.report import GateReport
from gates.reproducibility.latency_budget import LATENCY, MILLI, TERMS
from gates.stress.rollouts import STRESS
from genpolicy.evidence.rows.reproducibility import LatencyRow
from genpolicy.evidence.rows.stress import OverrunRow

FILE = f"{STRESS}/overruns.parquet"
DEADLINES = "term_deadlines"
NONE = "none"


def _declared(evidence: Evidence, report: GateReport) -> Table:
    """Every term: who owns it, what it may take, what is done beyond, and how often it was."""
    frame = evidence.rows(LATENCY, LatencyRow)
    declared = {term: (most_s, action) for term, most_s, action in report.settings[DEADLINES]}
    owners = dict(zip(frame["component"], frame["owner"], strict=True))
    warm = frame[frame["temperature"] == "warm"]
    methods = in_order(warm["method"])
    lines = []
    for term in TERMS:
        most_s, action = declared.get(term, (math.nan, ""))
        beyond = []
        for method in methods:
            times = numbers(
                warm[(warm["method"] == method) & (warm["component"] == term)], "seconds"
            )
            beyond.append(f"{int((times > most_s).sum())} of {len(times)}" if action else "")
        allowed = f"{most_s * MILLI:g}" if action else "not declared"
        lines.append((term, owners.get(term, ""), allowed, action or "nothing", *beyond))
    heads = ("term", "owner", "may take, ms", "beyond it", *(f"{m}, beyond" for m in methods))
    return (heads, *lines)


def _done(evidence: Evidence, report: GateReport) -> Table:
    return _counted(evidence, report, by=["method", "term", "action"])


def _conditions(evidence: Evidence, report: GateReport) -> Table:
    return _counted(evidence, report, by=["method", "perturbation", "term", "action"])


def _counted(evidence: Evidence, report: GateReport, *, by: list[str]) -> Table:
    require_bound(evidence, report, FILE)
    frame = evidence.rows(FILE, OverrunRow)
    counts = frame.assign(count=numbers(frame, "count")).groupby(by, sort=True)["count"].sum()
    index = counts.index.to_frame(index=False).astype(str)
    cells = [*(index[name] for name in by), (f"{count:g}" for count in counts)]
    lines = [tuple(cell or NONE for cell in line) for line in zip(*cells, strict=True)]
    return ((*by, "times"), *lines)


DECLARED = Listing(
    "What is done where a term takes too long?",
    "Each term of an answer has an owner, a time that it may take, and one action beyond that; the "
    "list of actions is closed (chapter 4.1). Behind them how many warm invocations here, or draws "
    "of a declared term, took longer. The virtual clock of Gate D does what is declared, and "
    "counts it there.",
    LATENCY,
    _declared,
)
DONE = Listing(
    "Terms that took too long, and what was done",
    "How often the clock did what was declared for a term, over all rollouts. An invocation that "
    "was ended so has missed its deadline and counts among the misses; one that went on does not. "
    "The journals say each of them, and `genpolicy verify report` draws the times again.",
    FILE,
    _done,
    folded=(Folded("Every condition", _conditions),),
)
