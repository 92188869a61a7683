"""Table of Gate D: how chunks meet what was commanded before, as proposed and as admitted."""

import numpy as np
import pandas as pd

from gates.evidence import Evidence, numbers
from gates.pages.bound import require_bound
from gates.pages.figures import Folded, Listing, Table, in_order
from gates.report import GateReport
from gates.stress.rollouts import STRESS
from genpolicy.evidence.rows.stress import SpliceRow

FILE = f"{STRESS}/splices.parquet"
HEADS = (
    "chunks", "with a say of earlier ones", "jump proposed, mm", "jump admitted, mm",
    "jerk proposed, m/s³", "jerk admitted, m/s³",
)  # fmt: skip
MM_PER_M = 1000.0


def _splices(evidence: Evidence, report: GateReport) -> pd.DataFrame:
    require_bound(evidence, report, FILE)
    return evidence.rows(FILE, SpliceRow)


def _typical(rows: pd.DataFrame, column: str, scale: float = 1.0) -> str:
    """Median and 95th percentile of what was measured."""
    known = rows[rows[column].notna()]
    if len(known) == 0:
        return "not measured"
    middle, high = np.quantile(scale * numbers(known, column), [0.5, 0.95], method="higher")
    return f"{middle:.3g}, p95 {high:.3g}"


def _line(rows: pd.DataFrame) -> tuple[str, ...]:
    return (
        f"{len(rows)}",
        f"{int(np.sum(numbers(rows, 'parents') > 0))}",
        _typical(rows, "raw_jump_m", MM_PER_M),
        _typical(rows, "jump_m", MM_PER_M),
        _typical(rows, "raw_jerk_m_s3"),
        _typical(rows, "jerk_m_s3"),
    )


def _listed(evidence: Evidence, report: GateReport) -> Table:
    frame = _splices(evidence, report)
    lines = [
        (method, str(rule), *_line(rows))
        for method in in_order(frame["method"])
        for rule, rows in frame[frame["method"] == method].groupby("rule", sort=True)
    ]
    return (("method", "joined by", *HEADS), *lines)


def _conditions(evidence: Evidence, report: GateReport) -> Table:
    frame = _splices(evidence, report)
    lines = [
        (method, str(condition), *_line(rows))
        for method in in_order(frame["method"])
        for condition, rows in frame[frame["method"] == method].groupby("perturbation", sort=True)
    ]
    return (("method", "condition", *HEADS), *lines)


LISTINGS = (
    Listing(
        "Splices",
        "How a chunk that entered the queue meets what was commanded before it: the way from the "
        "last command to its first row that was due, and the largest jerk of the TCP over that "
        "boundary, each as proposed and as admitted after projection; median, and p95, "
        "the 95th percentile. The rule is the comparison's, equal for all methods; a method "
        "that it cannot hold for stands with replace. Nothing here is judged: what is admitted "
        "keeps the limits of all six layers, and Gate C bounds the jerk.",
        FILE,
        _listed,
        folded=(Folded("Every condition", _conditions),),
    ),
)
