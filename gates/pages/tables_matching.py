"""Table of both rules by which a candidate is matched with what it is compared with (Gate B)."""

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.figures import Listing, Table
from gates.pages.limits import limit_of
from gates.report import GateReport
from gates.reproducibility.convergence import Fall
from gates.reproducibility.matching import pairs
from gates.reproducibility.settings import GENERATORS
from gates.words import share_between

LIMIT = "baseline_fall_upper"
HEADS = (
    "candidate", "baseline", "updates", "by equal updates", "candidate's loss still falls",
    "baseline's loss still falls", "near its end after", "by equal convergence", "may still learn",
)  # fmt: skip


def _rules(evidence: Evidence, report: GateReport) -> Table:
    limit = limit_of(report, LIMIT)
    if limit is None:
        raise MissingEvidenceError(f"{LIMIT} has no limit, which says what is done")
    settings = report.settings
    found = pairs(
        evidence,
        candidates=[name for name in report.candidates if name not in settings["brought"]],
        baselines=settings["baselines"],
        limit=limit,
        confidence=float(settings["confidence"]),
    )
    lines = [
        (
            pair.candidate.method,
            pair.baseline.method,
            f"{pair.candidate.updates} and {pair.baseline.updates}",
            pair.by_updates,
            _fall(pair.candidate.fall),
            _fall(pair.baseline.fall),
            f"{pair.candidate.near} and {pair.baseline.near}",
            pair.by_convergence,
            pair.remains or "neither",
        )
        for pair in found
    ]
    return (HEADS, *lines)


def _fall(fall: Fall) -> str:
    return share_between(fall.share, *fall.interval)


RULES = Listing(
    "Matched by two rules: equal updates, equal convergence",
    "One comparison is run, at equal updates; this is what each rule says of it. Equal convergence "
    f"asks the same of both sides: the loss falls by no more than the limit of {LIMIT} over the "
    "last quarter, at the worse end over held-out episodes. Near its end: the update from "
    "which on the loss was no further above its end than that share, as far as it was measured. "
    "What remains to a baseline is a criterion, since it may be all of a gain. What remains to a "
    "candidate it pays for itself, and of a density something remains however long it is trained; "
    "its samples are asked by late_change_upper.",
    f"{GENERATORS}/matched.json",
    _rules,
)
