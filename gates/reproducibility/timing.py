"""Timing: is every term of the latency known, and does a second process measure the same?"""

import numpy as np
import pandas as pd

from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.reproducibility.settings import ReproducibilitySettings
from genpolicy.evidence.rows.reproducibility import LatencyRow

LATENCY = "artifacts/latency/latency.parquet"
TERMS = (
    "exposure",
    "capture",
    "decode",
    "transfer",
    "preprocess",
    "encode",
    "sample",
    "select",
    "project",
    "network",
    "queue",
)
MEASURED_HERE = ("preprocess", "encode", "sample", "select", "project")


@criterion(
    "<=",
    question="Is each of the eleven latency terms known?",
    look_at="Timing: a missing term is unknown, never zero; measure or declare it.",
    per_candidate=True,
)
def latency_terms_missing(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Terms of the latency that are neither measured nor declared."""
    rows = _latency(evidence, candidate)
    known = rows[np.isfinite(rows["seconds"].to_numpy(dtype=np.float64, na_value=np.nan))]
    measured = set(known.loc[known["source"] == "measured", "component"])
    declared = sorted(set(known["component"]) - measured)
    missing = [
        term
        for term in TERMS
        if term not in measured and (term in MEASURED_HERE or term not in declared)
    ]
    text = f"missing: {', '.join(missing)}" if missing else f"declared: {', '.join(declared)}"
    return Measured(float(len(missing)), caveat=text)


def _latency(evidence: Evidence, candidate: str) -> pd.DataFrame:
    return evidence.of(LATENCY, LatencyRow, candidate)


@criterion(
    "<=",
    question="Do two independent runs agree on latency?",
    look_at="Timing: the machine was busy, or warm-up is incomplete; measure again.",
    per_candidate=True,
)
def latency_median_ratio(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Summed warm medians of two fresh processes, the slower over the faster."""
    rows = _latency(evidence, candidate)
    warm = rows[(rows["source"] == "measured") & (rows["temperature"] == "warm")]
    warm = warm.assign(seconds=numbers(warm, "seconds"))
    medians = warm.pivot_table(
        index="component", columns="run", values="seconds", aggfunc="median", dropna=False
    )
    if sorted(map(int, medians.columns)) != [1, 2] or bool(medians.isna().any(axis=None)):
        raise MissingEvidenceError("two runs of every measured component are needed")
    if len(medians) == 0 or not bool((medians > 0).all(axis=None)):
        raise MissingEvidenceError("a measured component took no time")
    first, second = float(medians[1].sum()), float(medians[2].sum())
    ratios = medians[1] / medians[2]
    ratios = ratios.where(ratios >= 1, 1 / ratios)
    text = (
        f"sum of component medians {first * 1e3:.4g} ms and {second * 1e3:.4g} ms, warm; "
        f"least stable component {ratios.idxmax()} at {float(ratios.max()):.3g}"
    )
    return Measured(max(first / second, second / first), caveat=text)
