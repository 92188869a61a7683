"""Gate A, need: does one observation truly admit several valid actions?

Either the modes are valid (route `valid_modes`) or a mode is shown to matter for recovery
(route `recovery`); data semantics, strata and matched baselines must hold in both cases.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import Field

from gates import need
from gates.engine import CriterionSpec, GateSpec, default_diagnosis, judge_gate
from gates.evidence import Evidence, MissingEvidenceError
from gates.models import Criterion, GateReport, StrictModel, Threshold, Verdict
from gates.need import AUDIT, BASELINES, REFUSALS, VALID_CAUSE


class Params(StrictModel):
    """Settings of Gate A other than thresholds.

    Attributes:
        confidence: Coverage of every interval.
        strata_level: Adjusted p-value at which a stratum counts as explaining the modes.
        held_out_splits: Splits whose situations are judged.
        baselines: Simpler policies that must be there, frozen and matched.
        deployed_conventions: Sampling conventions under which a baseline is deployed; drawing
            from a latent is a generator's way and is reported beside them.
    """

    confidence: float = Field(default=0.95, gt=0.5, lt=1.0)
    strata_level: float = Field(default=0.05, gt=0.0, lt=1.0)
    held_out_splits: tuple[str, ...] = ("validation", "test")
    baselines: tuple[str, ...] = ("bc", "chunked_bc", "act")
    deployed_conventions: tuple[str, ...] = ("direct", "z_zero")


def judge(root: Path, thresholds: Mapping[str, Threshold], params: Params) -> GateReport:
    """Report of Gate A from the evidence below `root`.

    Raises:
        ConfigError: A threshold of no criterion.
        IntegrityError: Evidence that is not what it claims to be.
    """
    evidence = Evidence(root)

    def diagnosis(criteria: Sequence[Criterion], verdict: Verdict) -> str:
        text = default_diagnosis(SPEC)(criteria, verdict)
        return f"{text} {_cause(evidence, passed=verdict == 'PASS')}".strip()

    return judge_gate(SPEC, evidence, thresholds, params, diagnosis=diagnosis)


def _cause(evidence: Evidence, *, passed: bool) -> str:
    try:
        summary = evidence.document(f"{AUDIT}/summary.json")
    except MissingEvidenceError as error:
        return f"Cause unknown: {error}."
    detail = next((str(summary[key]) for key in ("variable", "kind") if summary.get(key)), "")
    cause = f"{summary.get('cause')}({detail})" if detail else str(summary.get("cause"))
    text = f"Cause found by the audit: {cause}."
    return text if passed else f"{text} Next: {summary.get('next_action') or 'none'}"


SPEC = GateSpec(
    gate="A",
    bind=(
        "artifacts/ingest/frames.parquet",
        "artifacts/ingest/episodes.parquet",
        "artifacts/ingest/manifest.json",
        f"{AUDIT}/scene.png",
        f"{AUDIT}/examples.parquet",
        f"{AUDIT}/alignment.parquet",
        f"{BASELINES}/*/seed_*/model.safetensors",
        f"{BASELINES}/*/seed_*/config.json",
        f"{BASELINES}/offline.parquet",
    ),
    back_to="the dataset, the observation, or the simpler policy",
    go_on="A generator is a candidate: train diffusion and flow under the matched configuration.",
    caveats=(
        "Modes are clusters of recorded chunks; a mode that no demonstrator used is not seen.",
        "Conditional tests see measured variables only; an unrecorded one can still explain modes.",
    ),
    criteria=(
        CriterionSpec(
            "refused_recordings_accounted",
            "Is every recording either accepted or refused by name?",
            "<=",
            "perception",
            (REFUSALS,),
            need.refused_recordings,
            "Data semantics: a recording vanished at ingest; read the refusals.",
        ),
        CriterionSpec(
            "clock_residual_s",
            "Do the clocks of all streams agree after realignment?",
            "<=",
            "perception",
            (f"{AUDIT}/clocks.parquet",),
            need.clock_residual,
            "Data semantics: recheck timestamps per stream and epoch before anything else.",
        ),
        CriterionSpec(
            "lag_spread_steps",
            "Is the lag from action to state the same in every epoch?",
            "<=",
            "controller",
            (f"{AUDIT}/clocks.parquet",),
            need.lag_spread,
            "Data semantics: actions and states are shifted against each other in some epochs.",
        ),
        CriterionSpec(
            "calibration_residual_m",
            "Are the calibration epochs consistent?",
            "<=",
            "perception",
            (f"{AUDIT}/calibration.parquet",),
            need.calibration_residual,
            "Data semantics: an epoch's frames drifted; recalibrate or exclude it by name.",
        ),
        CriterionSpec(
            "label_disagreement",
            "Do outcome labels agree with replay?",
            "<=",
            "model",
            (f"{AUDIT}/replay.parquet",),
            need.label_disagreement,
            "Data semantics: failed episodes are labelled successful; correct labels first.",
        ),
        CriterionSpec(
            "held_out_situations",
            "Were enough held-out situations examined?",
            ">=",
            "model",
            (f"{AUDIT}/neighbourhoods.parquet",),
            need.held_out_situations,
            "Multimodality: too little support; record more episodes of the same task.",
        ),
        CriterionSpec(
            "multimodal_situations",
            "In how many do two persistent modes exist?",
            ">=",
            "model",
            (f"{AUDIT}/neighbourhoods.parquet",),
            need.multimodal_situations,
            "Multimodality: the actions are unimodal here; keep the simpler policy.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "persistence_margin",
            "Does mode identity persist over steps, beyond a shuffled-time null?",
            ">=",
            "model",
            (f"{AUDIT}/persistence.json",),
            need.persistence_margin,
            "Multimodality: this is pointwise noise (tremor, quantisation), not a mode.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "mode_success_lower",
            "Does each mode succeed?",
            ">=",
            "model",
            (f"{AUDIT}/modes.parquet",),
            need.mode_success,
            "Multimodality: a mode fails; separate failed and intervention targets.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "mode_feasible_share",
            "Is each mode feasible in all layers?",
            ">=",
            "controller",
            (f"{AUDIT}/modes.parquet",),
            need.mode_feasible,
            "Multimodality: a mode breaks limits or collides; it is no valid target.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "mean_defeated_share",
            "Is the mean rejected where every mode passes?",
            ">=",
            "model",
            (f"{AUDIT}/neighbourhoods.parquet",),
            need.mean_defeated,
            "Multimodality: the mean action is admissible, so a point policy loses nothing.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "recovery_benefit",
            "Does a mode matter for recovery?",
            ">=",
            "model",
            (f"{AUDIT}/recovery.parquet",),
            need.recovery_benefit,
            "Multimodality: no mode is better at recovering.",
            route="recovery",
        ),
        CriterionSpec(
            "strata_effect",
            "Does phase, object, operator or epoch explain the modes?",
            "<=",
            "perception",
            (f"{AUDIT}/strata.parquet",),
            need.strata_effect,
            "Conditioning: a recorded variable explains the modes; give it to the policy.",
        ),
        CriterionSpec(
            "cause_accepted",
            "Does the audit attribute the modes to the task itself?",
            ">=",
            "model",
            (f"{AUDIT}/summary.json",),
            need.cause_accepted,
            "Conditioning: the audit found another cause than valid modes; remove it first.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "baselines_matched",
            "Are BC, chunked BC and ACT frozen under one configuration?",
            "<=",
            "model",
            (f"{BASELINES}/matched.json",),
            need.baselines_matched,
            "Baselines: configurations differ in more than the head; retrain them matched.",
        ),
        CriterionSpec(
            "baseline_mode_coverage",
            "Does the best simple policy lose modes?",
            "<=",
            "model",
            (f"{BASELINES}/modes.parquet",),
            need.baseline_coverage,
            "Baselines: a simple policy already covers the modes; keep it.",
        ),
    ),
)
