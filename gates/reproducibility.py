"""Gate B, reproducibility: is a candidate pinned, and does it come back the same?"""

from typing import Any

import numpy as np
import pandas as pd

from gates.bounds import counted_interval
from gates.criterion import Measured, criteria_of, criterion
from gates.engine import GateSpec
from gates.evidence import Evidence, MissingEvidenceError, count, number, numbers
from gates.need.settings import TRAINED as BASELINES
from gates.need.simpler import unmatched
from gates.settings import CandidateSettings
from genpolicy.evidence.rows.reproducibility import CoverageRow, LatencyRow, NfeRow, SampleRow

RELOAD = "artifacts/reload"
LATENCY = "artifacts/latency/latency.parquet"
GENERATORS = "artifacts/train_generators"
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


class ReproducibilitySettings(CandidateSettings):
    """Settings of Gate B other than limits.

    Attributes:
        budget_reference: Method whose parameter count is the budget.
        budget_parts: Parts of the model whose parameters are compared, summed.
    """

    budget_reference: str
    budget_parts: tuple[str, ...]


@criterion(
    "<=",
    question="Does the configuration differ only where a generator must?",
    look_at="Conditioning: the comparison is not matched; align the configurations.",
    per_candidate=True,
)
def unmatched_keys(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Settings in which the candidate differs although no whitelist allows it."""
    return unmatched(evidence, f"{GENERATORS}/matched.json", (candidate,))


@criterion(
    "<=",
    question="Is the parameter budget kept?",
    look_at="Generator training: the head is larger or smaller than the budget.",
    per_candidate=True,
)
def parameter_budget_deviation(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Parameters against those of the reference, as a share off."""
    reference = settings.budget_reference
    budget = _parameters(evidence, f"{BASELINES}/matched.json", reference, settings)
    own = _parameters(evidence, f"{GENERATORS}/matched.json", candidate, settings)
    if budget <= 0:
        raise MissingEvidenceError(f"{reference} has no parameters")
    text = f"{own:g} parameters, budget {budget:g} ({reference})"
    return Measured(abs(own / budget - 1.0), caveat=text)


def _parameters(
    evidence: Evidence, path: str, method: str, settings: ReproducibilitySettings
) -> float:
    methods = evidence.document(path).get("methods")
    entry = methods.get(method) if isinstance(methods, dict) else None
    parts = entry.get("parameters") if isinstance(entry, dict) else None
    if not isinstance(parts, dict):
        raise MissingEvidenceError(f"{path} counts no parameters of {method}")
    return sum(number(parts, part) for part in settings.budget_parts)


@criterion(
    "<=",
    question="Are checkpoint, configuration, data, seed and sampler pinned?",
    look_at="Generator training: something is not pinned by hash; train again from a clean state.",
    per_candidate=True,
)
def unpinned_items(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Items that are not pinned by hash."""
    entry = _identity(evidence, candidate)
    missing = [name for name in PINNED if entry.get(name) in (None, "", [], {})]
    files = evidence.bind(
        f"{GENERATORS}/{candidate}/seed_*/model.safetensors",
        f"{GENERATORS}/{candidate}/seed_*/config.json",
    )
    if not any(file.endswith("model.safetensors") for file in files):
        missing.append("checkpoint file")
    if entry.get("dataset") != evidence.digest(MANIFEST):
        missing.append("dataset: trained on another one than the audited")
    return Measured(float(len(missing)), caveat=", ".join(missing) or "all pinned by hash")


def _identity(evidence: Evidence, candidate: str) -> dict[str, Any]:
    entry = evidence.document(f"{RELOAD}/identity.json").get(candidate)
    if not isinstance(entry, dict):
        raise MissingEvidenceError(f"identity.json has no entry of {candidate}")
    return entry


@criterion(
    "<=",
    question="Are all weights finite?",
    look_at="Generator training: training diverged; lower the rate or look at the data.",
    per_candidate=True,
)
def nonfinite_weights(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Weights that are NaN or infinite."""
    return Measured(count(_identity(evidence, candidate), "nonfinite_weights"))


@criterion(
    "<=",
    question="Does a fresh process read back the same metadata?",
    look_at="Generator training: save and reload disagree on metadata.",
    per_candidate=True,
)
def metadata_mismatches(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Metadata that a fresh process reads otherwise than they were written."""
    return Measured(count(_identity(evidence, candidate), "metadata_mismatches"))


@criterion(
    "<=",
    question="Does a fresh process draw the same samples?",
    look_at="Sampler: noise is not keyed by name, or batch shape and threads changed.",
    per_candidate=True,
)
def samples_difference(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Largest difference of a sample after reload, in its own unit."""
    rows = evidence.of(f"{RELOAD}/samples.parquet", SampleRow, candidate)
    largest = float(np.abs(numbers(rows, "max_abs_difference")).max())
    unequal = int((rows["sha256_trained"] != rows["sha256_reloaded"]).sum())
    if rows[["sha256_trained", "sha256_reloaded"]].isna().any(axis=None):
        raise MissingEvidenceError("a sample has no hash")
    if unequal and largest == 0.0:
        raise MissingEvidenceError(f"{unequal} hashes differ although no sample is said to")
    seeds = rows["seed"].nunique()
    text = f"{len(rows)} samples of {seeds} training seeds, {unequal} not bit-equal"
    return Measured(largest, caveat=text)


@criterion(
    "<=",
    question="Is the NFE counted at the network the NFE recorded?",
    look_at="Sampler: the solver evaluates the network more or less often than it says.",
    per_candidate=True,
)
def nfe_mismatch(evidence: Evidence, settings: ReproducibilitySettings, candidate: str) -> Measured:
    """Largest difference between recorded and counted network evaluations."""
    rows = evidence.of(f"{RELOAD}/nfe.parquet", NfeRow, candidate)
    difference = np.abs(numbers(rows, "recorded") - numbers(rows, "counted"))
    text = f"recorded {_chosen_nfe(evidence, candidate):g}, counted at the network"
    return Measured(float(difference.max()), caveat=text)


def _chosen_nfe(evidence: Evidence, candidate: str) -> float:
    rows = evidence.of(f"{RELOAD}/nfe.parquet", NfeRow, candidate)
    found = sorted(set(numbers(rows, "recorded").tolist()))
    if len(found) != 1:
        raise MissingEvidenceError(f"{candidate} records several NFE: {found}")
    return float(found[0])


@criterion(
    ">=",
    question="Does it cover the modes at the chosen NFE?",
    look_at="Sampler: modes are lost at this NFE; look at the coverage curve and at training.",
    per_candidate=True,
)
def mode_coverage_lower(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Lower bound of the share of situations of which every mode is reached, at the chosen NFE."""
    rows = evidence.of(f"{RELOAD}/coverage.parquet", CoverageRow, candidate)
    chosen = rows[numbers(rows, "nfe") == _chosen_nfe(evidence, candidate)]
    if len(chosen) == 0:
        raise MissingEvidenceError("coverage was not measured at the chosen NFE")
    shares, situations = numbers(chosen, "modes_covered_share"), numbers(chosen, "situations")
    found = []
    for share, trials in zip(shares, situations, strict=True):
        hits = np.floor(round(float(share * trials), 9))
        found.append(
            (counted_interval(float(hits), float(trials), confidence=settings.confidence), share)
        )
    interval, share = min(found)
    text = f"share {share:.4g} over {situations.min():g} two-mode situations at the chosen NFE"
    return Measured(interval[0], interval, text)


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


GATE = GateSpec(
    gate="B",
    settings=ReproducibilitySettings,
    criteria=criteria_of(globals()),
    bind=(f"{RELOAD}/offline.parquet", f"{RELOAD}/modes.parquet"),
    back_to="training",
    go_on="Sample every passing candidate in shadow, on held-out and corrupted observations.",
    caveats=(
        "Bit equality holds for the same wheels, CPU capability, thread count and batch shape.",
        "Latency was measured on one machine; sensor and network terms are declared, not measured.",
        "Mode coverage is counted on recorded two-mode situations, not on a likelihood.",
    ),
    below="A",
)
