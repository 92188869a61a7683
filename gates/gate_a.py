"""Gate A, need: does one observation truly admit several valid actions?

Either the modes are valid (route `valid_modes`) or a mode is shown to matter for recovery
(route `recovery`); data semantics, strata and matched baselines must hold in both cases.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import Field

from gates import need, shortcuts
from gates.cause import CauseLimits, limits_of
from gates.cause.limits import SHARED
from gates.engine import CriterionSpec, GateSpec, default_diagnosis, judge_gate
from gates.evidence import Evidence, MissingEvidenceError
from gates.models import Criterion, GateReport, StrictModel, Threshold, Verdict
from gates.need import AUDIT, BASELINES, REFUSALS, VALID_CAUSE
from gates.shortcuts import FACTORS, LATENT, VARIANTS

CAUSE_EVIDENCE = (
    "summary.json", "persistence.json", "findings.parquet", "strata.parquet", "modes.parquet",
    "resamples.parquet",
)  # fmt: skip


class Params(StrictModel):
    """Settings of Gate A other than thresholds.

    Attributes:
        confidence: Coverage of every interval.
        strata_level: Adjusted p-value at which a stratum counts as explaining the modes.
        held_out_splits: Splits whose situations are judged.
        baselines: Simpler policies that must be there, frozen and matched.
        deployed_conventions: Sampling conventions under which a baseline is deployed; drawing
            from a latent is a generator's way and is reported beside them.
        generative_baselines: Baselines that are drawn at random under every convention (an
            energy's candidates are), so that they are reported beside the deployed ones.
        chunked_baseline: Baseline that shows what chunking alone does.
        latent_baseline: Baseline whose latent must answer the observation.
        factors: Factors of which each must have been changed alone.
        conditioning_factors: Factors that could make a density unnecessary; a head is what the
            gate is about, and a single action commits to no mode.
        cause: Limits of the questions that only the audit's cause asks, by owner: limit and
            reason; the others stand in the thresholds.
    """

    confidence: float = Field(default=0.95, gt=0.5, lt=1.0)
    strata_level: float = Field(default=0.05, gt=0.0, lt=1.0)
    held_out_splits: tuple[str, ...] = ("validation", "test")
    baselines: tuple[str, ...] = ("bc", "chunked_bc", "act", "ibc")
    deployed_conventions: tuple[str, ...] = ("direct", "z_zero")
    generative_baselines: tuple[str, ...] = ("ibc",)
    chunked_baseline: str = "chunked_bc"
    latent_baseline: str = "act"
    factors: tuple[str, ...] = ("reference", "representation", "trunk", "head", "temporal")
    conditioning_factors: tuple[str, ...] = ("representation", "trunk")
    cause: dict[str, dict[str, tuple[float, str]]] = Field(default_factory=dict)


def judge(root: Path, thresholds: Mapping[str, Threshold], params: Params) -> GateReport:
    """Report of Gate A from the evidence below `root`.

    Raises:
        ConfigError: A threshold of no criterion.
        IntegrityError: Evidence that is not what it claims to be.
    """
    evidence = Evidence(root)
    limits = (
        limits_of(params.cause, thresholds, where="params.yaml: gate_a.cause")
        if params.cause and set(SHARED) <= set(thresholds)
        else None
    )

    def diagnosis(criteria: Sequence[Criterion], verdict: Verdict) -> str:
        text = default_diagnosis(SPEC)(criteria, verdict)
        return f"{text} {_cause(evidence, limits, passed=verdict == 'PASS')}".strip()

    extra = {"cause_limits": limits}
    return judge_gate(SPEC, evidence, thresholds, params, extra=extra, diagnosis=diagnosis)


def _cause(evidence: Evidence, limits: CauseLimits | None, *, passed: bool) -> str:
    try:
        cause = need.found_cause(evidence, limits)
    except MissingEvidenceError as error:
        return f"Cause unknown: {error}."
    text = f"Cause found by the audit: {cause.text}."
    return text if passed else f"{text} Next: {cause.next_action}"


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
        f"{FACTORS}/*/seed_*/model.safetensors",
        f"{FACTORS}/*/seed_*/config.json",
        f"{FACTORS}/errors.parquet",
        f"{FACTORS}/effects.parquet",
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
            tuple(f"{AUDIT}/{name}" for name in CAUSE_EVIDENCE),
            need.cause_accepted,
            "Conditioning: the audit found another cause than valid modes; remove it first.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "phase_collapse_share",
            "Do the modes collapse when the phase is seen?",
            "<=",
            "perception",
            (f"{AUDIT}/summary.json",),
            shortcuts.phase_collapse,
            "Conditioning: the phase explains the modes; give it to the policy.",
        ),
        CriterionSpec(
            "baselines_matched",
            "Are BC, chunked BC, ACT and IBC frozen under one configuration?",
            "<=",
            "model",
            (f"{BASELINES}/matched.json",),
            need.baselines_matched,
            "Baselines: configurations differ in more than the head; retrain them matched.",
        ),
        CriterionSpec(
            "chunking_valid_share",
            "Does chunking alone remove the mean action?",
            "<=",
            "model",
            (f"{BASELINES}/modes.parquet",),
            shortcuts.chunking_valid,
            "Baselines: temporal context was missing, not a density; keep chunked BC.",
        ),
        CriterionSpec(
            "latent_dependence_p",
            "Do ACT's samples depend on the observation beyond chance?",
            "<=",
            "model",
            (LATENT,),
            shortcuts.latent_dependence,
            "Baselines: the latent encodes style or noise; clean the demonstrations first.",
        ),
        CriterionSpec(
            "factors_isolated",
            "Was each factor changed alone?",
            "<=",
            "model",
            (VARIANTS,),
            shortcuts.factors_isolated,
            "Baselines: a variant changes more than its factor, so nothing is separated.",
        ),
        CriterionSpec(
            "factor_valid_share",
            "Does another encoder, history or trunk alone remove the mean action?",
            "<=",
            "model",
            (f"{FACTORS}/modes.parquet", VARIANTS),
            shortcuts.factor_valid,
            "Baselines: the conditioning was too poor; take that encoder, history or trunk.",
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
