"""Gate B, reproducibility: is a candidate pinned, and does it come back the same?"""

from dataclasses import replace

import numpy as np
import pandas as pd

from gates.claim import CHECKPOINT_ONLY, trainings
from gates.configured import compared, unsaid
from gates.criterion import Measured, criteria_of, criterion
from gates.distilled import spent
from gates.engine import GateSpec, Judged
from gates.evidence import Array, Evidence, MissingEvidenceError, numbers
from gates.may_differ import unmatched
from gates.need.settings import TRAINED as BASELINES
from gates.reproducibility import conformance, convergence, modes, timing, variations
from gates.reproducibility.compute import cost_of, cost_said
from gates.reproducibility.files import (
    nonfinite_that_lie,
    require_by_definition,
    weights_that_lie,
)
from gates.reproducibility.fixtures import require_as_trained
from gates.reproducibility.front import SWEEP
from gates.reproducibility.matching import matched_by
from gates.reproducibility.pins import TOTAL, config_of, identity_of, unpinned
from gates.reproducibility.planned import require_fixtures
from gates.reproducibility.settings import (
    COVERAGE,
    DENSITY,
    GENERATORS,
    NFE,
    RELOAD,
    SAMPLES,
    ReproducibilitySettings,
)
from gates.words import number
from genpolicy.evidence.documents.brought import FAULTS
from genpolicy.evidence.documents.given import MATCHED, DistilledConfig
from genpolicy.evidence.documents.reproducibility import CandidateIdentity
from genpolicy.evidence.rows.reproducibility import FIXTURES_ON, NfeRow, SampleRow


@criterion(
    "<=",
    question="Does the configuration differ only where a generator must?",
    look_at="Conditioning: the comparison is not matched; align the configurations.",
    per_candidate=True,
)
def unmatched_keys(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Settings in which the candidate differs although nothing allows it."""
    if candidate in settings.brought:
        text = (
            f"{candidate} was trained elsewhere: nothing of its training is matched, and no "
            f"exception is written (gate_b.unmatched.{candidate}: owner, reason, expires)"
        )
        return Measured(1.0, caveat=text)
    found = unmatched(evidence, GENERATORS, (candidate,), settings.may_differ)
    counted = f"all {compared(evidence, GENERATORS, candidate)} settings"
    if hidden := unsaid(evidence, GENERATORS, candidate):
        text = f"{', '.join(hidden)}: configured otherwise than the reference, and not listed"
        return Measured((found.value or 0.0) + len(hidden), caveat=text, counted=counted)
    return replace(found, counted=counted)


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
    budget = _parameters(evidence, BASELINES, reference)
    own = _parameters(evidence, GENERATORS, candidate)
    if budget <= 0:
        raise MissingEvidenceError(f"{reference} has no parameters")
    config = config_of(evidence, candidate)
    text = f"{own:g} parameters, budget {budget:g} ({reference}); "
    text += cost_said(cost_of(evidence, candidate, config))
    if isinstance(config, DistilledConfig):
        text = f"{text}; {spent(config.distilled)}"
    return Measured(abs(own / budget - 1.0), caveat=text)


def _parameters(evidence: Evidence, folder: str, method: str) -> float:
    entry = evidence.document(folder, MATCHED).methods.get(method)
    if entry is None or TOTAL not in entry.parameters:
        raise MissingEvidenceError(f"{folder}/{MATCHED.file} counts no parameters of {method}")
    return float(entry.parameters[TOTAL])


@criterion(
    "<=",
    question="Are checkpoint, data, seed and sampler pinned, and all of the identity card known?",
    look_at="Generator training: something is not pinned by hash; train again from a clean state.",
    per_candidate=True,
    always=True,
)
def unpinned_items(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Items that are not pinned by hash, not recorded, or not what the checkpoint says."""
    return unpinned(evidence, settings, candidate)


@criterion(
    "<=",
    question="Are all weights finite, and is what they draw?",
    look_at="Generator training: training diverged; lower the rate or look at the data.",
    per_candidate=True,
    always=True,
)
def nonfinite_weights(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Weights and chunks that are not finite; behind the wire, answers without a finite chunk."""
    entry = identity_of(evidence, candidate)
    found = float(entry.nonfinite_weights + entry.nonfinite_chunks)
    if candidate not in settings.brought:
        lie, texts = nonfinite_that_lie(evidence, candidate), []
        if lie != entry.nonfinite_weights:
            texts.append(f"{entry.nonfinite_weights} weights are said to be none, {lie} are")
        if entry.nonfinite_chunks:
            texts.append(_chunks_said(entry))
        most = max(lie, entry.nonfinite_weights) + entry.nonfinite_chunks
        counted = f"all {number(weights_that_lie(evidence, candidate))} weights"
        return Measured(float(most), caveat="; ".join(texts), counted=counted)
    text = "behind the wire nobody sees weights: counted are invocations without a finite chunk"
    return Measured(found, caveat=f"{text}{_failed(evidence, candidate)}")


def _chunks_said(entry: CandidateIdentity) -> str:
    """Chunks of its own sampler that are none, and how many of them its cap ended."""
    none = entry.nonfinite_chunks - entry.given_up
    texts = [f"{none} chunks of its own sampler hold a number that is none"] if none else []
    if entry.given_up:
        texts.append(f"{entry.given_up} were given up at sampler.nfe_cap and never came")
    return "; ".join(texts)


def _failed(evidence: Evidence, candidate: str) -> str:
    """How its process failed, by kind, and its last words; empty where it did not."""
    if not evidence.bind(f"{RELOAD}/{FAULTS.file}"):
        return ""
    own = evidence.document(RELOAD, FAULTS).get(candidate)
    if own is None or not own.faults:
        return ""
    kinds = ", ".join(f"{kind} {number}" for kind, number in sorted(own.faults.items()))
    return f"; of {own.asked} invocations failed: {kinds}; the last because {own.last_words}"


@criterion(
    "<=",
    question="Does a fresh process read back the same metadata?",
    look_at="Generator training: save and reload disagree on metadata.",
    per_candidate=True,
    always=True,
)
def metadata_mismatches(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Metadata that a fresh process reads otherwise than they were written."""
    return Measured(float(identity_of(evidence, candidate).metadata_mismatches))


@criterion(
    "<=",
    question="Does a fresh process draw the same samples?",
    look_at="Sampler: noise is not keyed by name, or batch shape and threads changed.",
    per_candidate=True,
    always=True,
)
def samples_difference(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Largest difference of a sample after reload, in its own unit."""
    rows = evidence.of(SAMPLES, SampleRow, candidate)
    if rows.duplicated(["seed", "device", "row"]).any():
        raise MissingEvidenceError(f"{SAMPLES} has a fixture of {candidate} twice")
    largest = float(np.abs(numbers(rows, "max_abs_difference")).max())
    unequal = int((rows["sha256_trained"] != rows["sha256_reloaded"]).sum())
    if (rows[["sha256_trained", "sha256_reloaded"]] == "").any(axis=None) and largest == 0.0:
        raise MissingEvidenceError("samples without a hash are said not to differ")
    if unequal and largest == 0.0:
        raise MissingEvidenceError(f"{unequal} hashes differ although no sample is said to")
    require_fixtures(rows, settings, candidate)
    seeds = rows["seed"].nunique()
    counted = f"all {len(rows)} samples"
    text = f"{len(rows)} samples {trainings(seeds)}, {unequal} not bit-equal"
    if candidate not in settings.brought:
        text += _where_drawn(rows, settings.device)
        require_as_trained(evidence, rows, candidate, identity_of(evidence, candidate))
    return Measured(largest, caveat=text, counted=counted)


def _where_drawn(rows: pd.DataFrame, device: str) -> str:
    """That of every seed the fixtures of training came back on the CPU, and those of the device.

    Raises:
        MissingEvidenceError: They were not drawn in one of these places.
    """
    for place in dict.fromkeys((FIXTURES_ON, device)):
        if set(rows.loc[rows["device"] == place, "seed"]) != set(rows["seed"]):
            raise MissingEvidenceError(f"not every seed was drawn again on {place}")
    if device == FIXTURES_ON:
        return ""
    return f"; on {device}, two processes that loaded there against each other"


@criterion(
    "<=",
    question="Does the network run as often as recorded, and as the sampler's definition says?",
    look_at="Sampler: the solver evaluates the network more or less often than it says.",
    per_candidate=True,
    always=True,
)
def nfe_mismatch(evidence: Evidence, settings: ReproducibilitySettings, candidate: str) -> Measured:
    """Largest difference of counted network evaluations from recorded or expected ones."""
    rows = evidence.of(NFE, NfeRow, candidate)
    recorded, counted, expected, least, most = (
        numbers(rows, name) for name in ("recorded", "counted", "expected", "least", "most")
    )
    if not all(np.all(count >= 1) for count in (recorded, counted, least)):
        raise MissingEvidenceError("a sample without a network evaluation was counted by nobody")
    if not np.all((least <= expected) & (expected <= most)):
        raise MissingEvidenceError("an expected count that its definition does not allow")
    if candidate not in settings.brought:
        require_by_definition(rows, candidate, config_of(evidence, candidate))
    difference = np.maximum(np.abs(recorded - counted), np.abs(expected - counted))
    text = (
        f"recorded {_range(recorded)}, counted {_range(counted)} at the network, "
        f"{_range(np.append(least, most))} by the definition of the sampler"
    )
    return Measured(float(difference.max()), caveat=text)


def _range(values: Array) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _both_rules(judged: Judged) -> list[str]:
    """Of whom equal updates or equal convergence do not hold, among those trained here."""
    settings: ReproducibilitySettings = judged.settings
    limit = settings.limits.of.get("baseline_fall_upper")
    return matched_by(
        judged.evidence,
        candidates=[name for name in judged.candidates if name not in settings.brought],
        baselines=settings.baselines,
        limit=limit.limit if limit is not None else None,
        confidence=settings.confidence,
    )


GATE = GateSpec(
    gate="B",
    settings=ReproducibilitySettings,
    criteria=criteria_of(
        globals(),
        vars(variations),
        vars(conformance),
        vars(convergence),
        vars(modes),
        vars(timing),
    ),
    bind=(
        f"{RELOAD}/offline.parquet",
        f"{RELOAD}/answers.parquet",
        COVERAGE,
        DENSITY,
        "artifacts/latency/candidates.parquet",
        "artifacts/latency/machine.parquet",
        SWEEP,
    ),
    back_to="training",
    go_on="Sample every passing candidate in shadow, on held-out and corrupted observations.",
    caveats=(
        CHECKPOINT_ONLY,
        "Bit equality holds for the same wheels, CPU capability, thread count and batch shape.",
        "Latency was measured on one machine; sensor and network terms are declared, not measured.",
        "Mode coverage is counted on recorded two-mode situations, not on a likelihood; where a "
        "head states one, it stands beside the shares and judges nothing.",
        "Updates are equal for all methods; how far each training has come is told beside them.",
    ),
    below="A",
    said=_both_rules,
)
