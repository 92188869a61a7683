"""Gate B, reproducibility: is a candidate pinned, and does it come back the same?"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import Field

from gates.bounds import counted_interval
from gates.engine import Case, CriterionSpec, GateSpec, Measured, judge_gate, standing
from gates.evidence import Evidence, MissingEvidenceError, count, number, numbers
from gates.models import GateReport, StrictModel, Threshold
from gates.need import unmatched_keys

RELOAD = "artifacts/reload"
LATENCY = "artifacts/latency/latency.parquet"
GENERATORS = "artifacts/generators"
MANIFEST = "artifacts/ingest/manifest.json"
PINNED = ("checkpoint", "config", "dataset", "normalisation", "seed", "sampler")
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


class Params(StrictModel):
    """Settings of Gate B other than thresholds.

    Attributes:
        confidence: Coverage of every interval.
        candidates: Methods that stand for promotion.
        budget_reference: Method whose parameter count is the budget.
        budget_parts: Parts of the model whose parameters are compared, summed.
    """

    confidence: float = Field(default=0.95, gt=0.5, lt=1.0)
    candidates: tuple[str, ...]
    budget_reference: str = "chunked_bc"
    budget_parts: tuple[str, ...] = ("total",)


def judge(root: Path, thresholds: Mapping[str, Threshold], params: Params) -> GateReport:
    """Report of Gate B from the evidence below `root`.

    Raises:
        ConfigError: A threshold of no criterion.
        IntegrityError: Evidence that is not what it claims to be.
    """
    caveats = standing(root, "A", ())[1]
    return judge_gate(
        SPEC, Evidence(root), thresholds, params, candidates=params.candidates, caveats=caveats
    )


def _samples_difference(case: Case) -> Measured:
    columns = ("seed", "sha256_trained", "sha256_reloaded", "max_abs_difference")
    rows = case.evidence.of(f"{RELOAD}/samples.parquet", case.candidate, *columns)
    largest = float(np.abs(numbers(rows, "max_abs_difference")).max())
    unequal = int((rows["sha256_trained"] != rows["sha256_reloaded"]).sum())
    if rows[["sha256_trained", "sha256_reloaded"]].isna().any(axis=None):
        raise MissingEvidenceError("a sample has no hash")
    if unequal and largest == 0.0:
        raise MissingEvidenceError(f"{unequal} hashes differ although no sample is said to")
    seeds = rows["seed"].nunique()
    text = f"{len(rows)} samples of {seeds} training seeds, {unequal} not bit-equal"
    return Measured(largest, caveat=text)


def _identity(case: Case) -> dict[str, Any]:
    entry = case.evidence.document(f"{RELOAD}/identity.json").get(case.candidate)
    if not isinstance(entry, dict):
        raise MissingEvidenceError(f"identity.json has no entry of {case.candidate}")
    return entry


def _metadata_mismatches(case: Case) -> Measured:
    return Measured(count(_identity(case), "metadata_mismatches"))


def _nonfinite_weights(case: Case) -> Measured:
    return Measured(count(_identity(case), "nonfinite_weights"))


def _unpinned_items(case: Case) -> Measured:
    entry = _identity(case)
    missing = [name for name in PINNED if entry.get(name) in (None, "", [], {})]
    files = case.evidence.bind(
        f"{GENERATORS}/{case.candidate}/seed_*/model.safetensors",
        f"{GENERATORS}/{case.candidate}/seed_*/config.json",
    )
    if not any(file.endswith("model.safetensors") for file in files):
        missing.append("checkpoint file")
    case.evidence.bind(MANIFEST)
    if entry.get("dataset") != case.evidence.materials.get(MANIFEST):
        missing.append("dataset: trained on another one than the audited")
    return Measured(float(len(missing)), caveat=", ".join(missing) or "all pinned by hash")


def _nfe_mismatch(case: Case) -> Measured:
    rows = case.evidence.of(f"{RELOAD}/nfe.parquet", case.candidate, "seed", "recorded", "counted")
    difference = np.abs(numbers(rows, "recorded") - numbers(rows, "counted"))
    text = f"recorded {_chosen_nfe(case):g}, counted at the network"
    return Measured(float(difference.max()), caveat=text)


def _chosen_nfe(case: Case) -> float:
    rows = case.evidence.of(f"{RELOAD}/nfe.parquet", case.candidate, "recorded")
    found = sorted(set(numbers(rows, "recorded").tolist()))
    if len(found) != 1:
        raise MissingEvidenceError(f"{case.candidate} records several NFE: {found}")
    return float(found[0])


def _latency(case: Case) -> pd.DataFrame:
    columns = ("run", "component", "temperature", "seconds", "source")
    return case.evidence.of(LATENCY, case.candidate, *columns)


def _latency_median_ratio(case: Case) -> Measured:
    rows = _latency(case)
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


def _latency_terms_missing(case: Case) -> Measured:
    rows = _latency(case)
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


def _parameters(case: Case, path: str, method: str) -> float:
    methods = case.evidence.document(path).get("methods")
    entry = methods.get(method) if isinstance(methods, dict) else None
    parts = entry.get("parameters") if isinstance(entry, dict) else None
    if not isinstance(parts, dict):
        raise MissingEvidenceError(f"{path} counts no parameters of {method}")
    return sum(number(parts, part) for part in case.params.budget_parts)


def _parameter_budget(case: Case) -> Measured:
    reference = case.params.budget_reference
    budget = _parameters(case, "artifacts/baselines/matched.json", reference)
    own = _parameters(case, f"{GENERATORS}/matched.json", case.candidate)
    if budget <= 0:
        raise MissingEvidenceError(f"{reference} has no parameters")
    text = f"{own:g} parameters, budget {budget:g} ({reference})"
    return Measured(abs(own / budget - 1.0), caveat=text)


def _unmatched_keys(case: Case) -> Measured:
    return unmatched_keys(case.evidence, f"{GENERATORS}/matched.json", (case.candidate,))


def _mode_coverage(case: Case) -> Measured:
    columns = ("nfe", "situations", "modes_covered_share")
    rows = case.evidence.of(f"{RELOAD}/coverage.parquet", case.candidate, *columns)
    chosen = rows[numbers(rows, "nfe") == _chosen_nfe(case)]
    if len(chosen) == 0:
        raise MissingEvidenceError("coverage was not measured at the chosen NFE")
    shares, situations = numbers(chosen, "modes_covered_share"), numbers(chosen, "situations")
    found = []
    for share, trials in zip(shares, situations, strict=True):
        hits = np.floor(round(float(share * trials), 9))
        found.append(
            (counted_interval(float(hits), float(trials), confidence=case.params.confidence), share)
        )
    interval, share = min(found)
    text = f"share {share:.4g} over {situations.min():g} two-mode situations at the chosen NFE"
    return Measured(interval[0], interval, text)


SPEC = GateSpec(
    gate="B",
    bind=(f"{GENERATORS}/offline.parquet", f"{GENERATORS}/modes.parquet"),
    back_to="training",
    go_on="Sample every passing candidate in shadow, on held-out and corrupted observations.",
    caveats=(
        "Bit equality holds for the same wheels, CPU capability, thread count and batch shape.",
        "Latency was measured on one machine; sensor and network terms are declared, not measured.",
        "Mode coverage is counted on recorded two-mode situations, not on a likelihood.",
    ),
    criteria=(
        CriterionSpec(
            "unmatched_keys",
            "Does the configuration differ only where a generator must?",
            "<=",
            "model",
            (f"{GENERATORS}/matched.json",),
            _unmatched_keys,
            "Conditioning: the comparison is not matched; align the configurations.",
            per_candidate=True,
        ),
        CriterionSpec(
            "parameter_budget_deviation",
            "Is the parameter budget kept?",
            "<=",
            "model",
            (f"{GENERATORS}/matched.json", "artifacts/baselines/matched.json"),
            _parameter_budget,
            "Generator training: the head is larger or smaller than the budget.",
            per_candidate=True,
        ),
        CriterionSpec(
            "unpinned_items",
            "Are checkpoint, configuration, data, seed and sampler pinned?",
            "<=",
            "model",
            (f"{RELOAD}/identity.json",),
            _unpinned_items,
            "Generator training: something is not pinned by hash; train again from a clean state.",
            per_candidate=True,
        ),
        CriterionSpec(
            "nonfinite_weights",
            "Are all weights finite?",
            "<=",
            "model",
            (f"{RELOAD}/identity.json",),
            _nonfinite_weights,
            "Generator training: training diverged; lower the rate or look at the data.",
            per_candidate=True,
        ),
        CriterionSpec(
            "metadata_mismatches",
            "Does a fresh process read back the same metadata?",
            "<=",
            "model",
            (f"{RELOAD}/identity.json",),
            _metadata_mismatches,
            "Generator training: save and reload disagree on metadata.",
            per_candidate=True,
        ),
        CriterionSpec(
            "samples_difference",
            "Does a fresh process draw the same samples?",
            "<=",
            "model",
            (f"{RELOAD}/samples.parquet",),
            _samples_difference,
            "Sampler: noise is not keyed by name, or batch shape and threads changed.",
            per_candidate=True,
        ),
        CriterionSpec(
            "nfe_mismatch",
            "Is the NFE counted at the network the NFE recorded?",
            "<=",
            "model",
            (f"{RELOAD}/nfe.parquet",),
            _nfe_mismatch,
            "Sampler: the solver evaluates the network more or less often than it says.",
            per_candidate=True,
        ),
        CriterionSpec(
            "mode_coverage_lower",
            "Does it cover the modes at the chosen NFE?",
            ">=",
            "model",
            (f"{RELOAD}/coverage.parquet", f"{RELOAD}/nfe.parquet"),
            _mode_coverage,
            "Sampler: modes are lost at this NFE; look at the coverage curve and at training.",
            per_candidate=True,
        ),
        CriterionSpec(
            "latency_terms_missing",
            "Is each of the eleven latency terms known?",
            "<=",
            "perception",
            (LATENCY,),
            _latency_terms_missing,
            "Timing: a missing term is unknown, never zero; measure or declare it.",
            per_candidate=True,
        ),
        CriterionSpec(
            "latency_median_ratio",
            "Do two independent runs agree on latency?",
            "<=",
            "controller",
            (LATENCY,),
            _latency_median_ratio,
            "Timing: the machine was busy, or warm-up is incomplete; measure again.",
            per_candidate=True,
        ),
    ),
)
