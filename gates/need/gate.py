"""Gate A as a whole: its questions in the order in which a failure is diagnosed.

Either the modes are valid (route `valid_modes`) or a mode is shown to matter for recovery
(route `recovery`); data semantics, strata and matched baselines must hold in both cases.
"""

from gates.criterion import criteria_of
from gates.engine import GateSpec, Judged
from gates.evidence import MissingEvidenceError
from gates.need import conditioning, modes, semantics, simpler
from gates.need.settings import (
    AUDIT,
    MEASURED,
    MEASURED_FACTORS,
    TRAINED,
    TRAINED_FACTORS,
    NeedSettings,
)


def _cause(judged: Judged) -> str:
    """The cause that the audit found, and after a verdict other than PASS what it asks for."""
    try:
        summary = judged.evidence.document(f"{AUDIT}/summary.json")
    except MissingEvidenceError as error:
        return f"Cause unknown: {error}."
    detail = next((str(summary[key]) for key in ("variable", "kind") if summary.get(key)), "")
    cause = f"{summary.get('cause')}({detail})" if detail else str(summary.get("cause"))
    text = f"Cause found by the audit: {cause}."
    if judged.verdict == "PASS":
        return text
    return f"{text} Next: {summary.get('next_action') or 'none'}"


GATE = GateSpec(
    gate="A",
    settings=NeedSettings,
    criteria=criteria_of(vars(semantics), vars(modes), vars(conditioning), vars(simpler)),
    bind=(
        "artifacts/ingest/frames.parquet",
        "artifacts/ingest/episodes.parquet",
        "artifacts/ingest/manifest.json",
        f"{AUDIT}/scene.png",
        f"{AUDIT}/examples.parquet",
        f"{AUDIT}/alignment.parquet",
        f"{TRAINED}/*/seed_*/model.safetensors",
        f"{TRAINED}/*/seed_*/config.json",
        f"{MEASURED}/offline.parquet",
        f"{TRAINED_FACTORS}/*/seed_*/model.safetensors",
        f"{TRAINED_FACTORS}/*/seed_*/config.json",
        f"{MEASURED_FACTORS}/errors.parquet",
        f"{MEASURED_FACTORS}/effects.parquet",
    ),
    back_to="the dataset, the observation, or the simpler policy",
    go_on="A generator is a candidate: train diffusion and flow under the matched configuration.",
    caveats=(
        "Modes are clusters of recorded chunks; a mode that no demonstrator used is not seen.",
        "Conditional tests see measured variables only; an unrecorded one can still explain modes.",
        "An energy policy (IBC) draws its candidates at random: a generator, reported beside the "
        "deployed baselines and not judged as one.",
        "Factors are separated after a short training with one seed; their intervals cover "
        "held-out episodes, not training, and small effects may be luck.",
    ),
    note=_cause,
)
