"""Gate A, need: does one observation truly admit several valid actions?

Either the modes are valid (route `valid_modes`) or a mode is shown to matter for recovery
(route `recovery`); data semantics, strata and matched baselines must hold in both cases.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import Field

from gates.bounds import counted_interval, share_interval
from gates.engine import Case, CriterionSpec, GateSpec, Measured, default_diagnosis, judge_gate
from gates.evidence import Evidence, MissingEvidenceError, count, flags, number, numbers
from gates.models import Criterion, GateReport, StrictModel, Threshold, Verdict
from genpolicy.statistics.intervals import clopper_pearson

AUDIT = "artifacts/audit"
BASELINES = "artifacts/baselines"
REFUSALS = "artifacts/ingest/refusals.json"
VALID_CAUSE = "valid_modes"


class Params(StrictModel):
    """Settings of Gate A other than thresholds.

    Attributes:
        confidence: Coverage of every interval.
        strata_level: Adjusted p-value at which a stratum counts as explaining the modes.
        held_out_splits: Splits whose situations are judged.
        baselines: Simpler policies that must be there, frozen and matched.
    """

    confidence: float = Field(default=0.95, gt=0.5, lt=1.0)
    strata_level: float = Field(default=0.05, gt=0.0, lt=1.0)
    held_out_splits: tuple[str, ...] = ("validation", "test")
    baselines: tuple[str, ...] = ("bc", "chunked_bc", "act")


def judge(root: Path, thresholds: Mapping[str, Threshold], params: Params) -> GateReport:
    """Report of Gate A from the evidence below `root`.

    Raises:
        ConfigError: A threshold of no criterion.
        IntegrityError: Evidence that is not what it claims to be.
    """
    evidence = Evidence(root)

    def diagnosis(criteria: Sequence[Criterion], verdict: Verdict) -> str:
        text = default_diagnosis(SPEC)(criteria, verdict)
        return f"{text} {_cause(evidence)}".strip()

    return judge_gate(SPEC, evidence, thresholds, params, diagnosis=diagnosis)


def _cause(evidence: Evidence) -> str:
    try:
        summary = evidence.document(f"{AUDIT}/summary.json")
    except MissingEvidenceError as error:
        return f"Cause unknown: {error}."
    detail = next((str(summary[key]) for key in ("variable", "kind") if summary.get(key)), "")
    cause = f"{summary.get('cause')}({detail})" if detail else str(summary.get("cause"))
    return f"Cause found by the audit: {cause}. Next: {summary.get('next_action') or 'none'}"


def _refused_recordings(case: Case) -> Measured:
    document = case.evidence.document(REFUSALS)
    found, accepted = number(document, "found"), number(document, "accepted")
    refused = count(document, "refused")
    if found == 0:
        raise MissingEvidenceError("no recordings were found")
    text = f"{found:g} found, {accepted:g} accepted, {refused:g} refused"
    return Measured(abs(accepted + refused - found), caveat=text)


def _clock_residual(case: Case) -> Measured:
    frame = case.evidence.frame(f"{AUDIT}/clocks.parquet", "stream", "epoch", "offset_after_s")
    return Measured(float(np.abs(numbers(frame, "offset_after_s")).max()))


def _lag_spread(case: Case) -> Measured:
    frame = case.evidence.frame(f"{AUDIT}/clocks.parquet", "stream", "epoch", "lag_steps")
    lags = frame.assign(lag_steps=numbers(frame, "lag_steps")).groupby("stream")["lag_steps"]
    return Measured(float((lags.max() - lags.min()).max()), caveat="largest over streams")


def _calibration_residual(case: Case) -> Measured:
    frame = case.evidence.frame(f"{AUDIT}/calibration.parquet", "epoch", "residual_m")
    return Measured(float(np.abs(numbers(frame, "residual_m")).max()), caveat="largest over epochs")


def _label_disagreement(case: Case) -> Measured:
    frame = case.evidence.frame(f"{AUDIT}/replay.parquet", "episode_uuid", "label", "replayed")
    wrong = int((frame["label"] != frame["replayed"]).sum())
    interval = counted_interval(wrong, len(frame), confidence=case.params.confidence)
    text = f"{wrong} of {len(frame)} replayed episodes disagree; judged by the upper bound"
    return Measured(interval[1], interval, text)


def _held_out(case: Case, *columns: str) -> pd.DataFrame:
    path = f"{AUDIT}/neighbourhoods.parquet"
    frame = case.evidence.frame(path, "split", "episode_uuid", "two_mode", *columns)
    return frame[frame["split"].isin(case.params.held_out_splits)]


def _held_out_situations(case: Case) -> Measured:
    rows = _held_out(case)
    return Measured(float(len(rows)), caveat=f"from {rows['episode_uuid'].nunique()} episodes")


def _multimodal_situations(case: Case) -> Measured:
    rows = _held_out(case, "persistent")
    kept = rows[flags(rows, "two_mode") & flags(rows, "persistent")]
    text = f"from {kept['episode_uuid'].nunique()} episodes; two clusters that persist"
    return Measured(float(len(kept)), caveat=text)


def _persistence_margin(case: Case) -> Measured:
    document = case.evidence.document(f"{AUDIT}/persistence.json")
    observed, null = number(document, "observed"), number(document, "null_q95")
    text = f"observed {observed:.4g}, 95 % quantile of the shuffled-time null {null:.4g}"
    return Measured(observed - null, caveat=text)


def _mode_success(case: Case) -> Measured:
    columns = ("mode", "episodes", "successes")
    frame = case.evidence.frame(f"{AUDIT}/modes.parquet", *columns)
    bounds = [
        (counted_interval(hits, trials, confidence=case.params.confidence), str(mode))
        for mode, trials, hits in zip(
            frame["mode"],
            numbers(frame, "episodes"),
            numbers(frame, "successes"),
            strict=True,
        )
    ]
    interval, mode = min(bounds)
    text = f"lowest over {len(bounds)} modes, at {mode}; exact lower bound"
    return Measured(interval[0], interval, text)


def _mode_feasible(case: Case) -> Measured:
    columns = ("mode", "admissible", "checked")
    frame = case.evidence.frame(f"{AUDIT}/modes.parquet", *columns)
    checked = numbers(frame, "checked")
    if not np.all(checked > 0):
        raise MissingEvidenceError("a mode has no checked chunk")
    shares = numbers(frame, "admissible") / checked
    worst = int(np.argmin(shares))
    text = f"lowest over {len(shares)} modes, at {frame['mode'].iloc[worst]}"
    return Measured(float(shares[worst]), caveat=text)


def _mean_defeated(case: Case) -> Measured:
    rows = _held_out(case, "clusters", "mean_admissible", "modes_admissible")
    rows = rows[flags(rows, "two_mode")]
    if len(rows) == 0:
        return Measured(0.0, caveat="no held-out situation has two modes")
    if rows["mean_admissible"].isna().any():
        raise MissingEvidenceError("the mean was not checked in every two-mode situation")
    valid = numbers(rows, "modes_admissible") >= numbers(rows, "clusters")
    defeated = valid & ~flags(rows, "mean_admissible")
    share, lower, upper = share_interval(
        defeated,
        list(rows["episode_uuid"]),
        confidence=case.params.confidence,
        favourable=True,
    )
    text = (
        f"share {share:.4g} of {len(rows)} situations; lower bound over "
        f"{rows['episode_uuid'].nunique()} episodes, whose situations are not independent"
    )
    return Measured(lower, (lower, upper), text)


def _strata_effect(case: Case) -> Measured:
    columns = ("variable", "phase", "p_adjusted", "effect", "effect_lower", "effect_upper")
    frame = case.evidence.frame(f"{AUDIT}/strata.parquet", *columns)
    effects = np.abs(numbers(frame, "effect"))
    significant = numbers(frame, "p_adjusted") <= case.params.strata_level
    if not significant.any():
        return Measured(0.0, caveat=f"none of {len(frame)} strata is significant after Holm")
    row = int(np.argmax(np.where(significant, effects, -np.inf)))
    chosen = frame.iloc[row]
    ends = (chosen["effect_lower"], chosen["effect_upper"])
    interval = (float(ends[0]), float(ends[1])) if np.all(np.isfinite(ends)) else None
    text = f"{chosen['variable']} in {chosen['phase']} explains modes"
    return Measured(float(effects[row]), interval, text)


def _recovery(case: Case) -> tuple[float, tuple[float, float], str]:
    columns = ("split", "mode", "episodes", "successes")
    frame = case.evidence.frame(f"{AUDIT}/recovery.parquet", *columns)
    frame = frame.assign(episodes=numbers(frame, "episodes"), successes=numbers(frame, "successes"))
    by_mode = frame.groupby("mode")[["episodes", "successes"]].sum()
    bounds = {
        str(mode): clopper_pearson(
            int(row["successes"]), int(row["episodes"]), case.params.confidence
        )
        for mode, row in by_mode.iterrows()
    }
    best = max(bounds, key=lambda mode: bounds[mode])
    other = min(bounds, key=lambda mode: bounds[mode][1])
    low, high = bounds[best][0] - bounds[other][1], bounds[best][1] - bounds[other][0]
    return low, (low, high), f"recovery by {best} against recovery by {other}; lower bound"


def _recovery_benefit(case: Case) -> Measured:
    value, interval, text = _recovery(case)
    return Measured(value, interval, text)


def _cause_accepted(case: Case) -> Measured:
    cause = case.evidence.document(f"{AUDIT}/summary.json").get("cause")
    if not isinstance(cause, str) or not cause:
        raise MissingEvidenceError("the audit names no cause")
    return Measured(float(cause == VALID_CAUSE), caveat=f"cause: {cause}")


def _baselines_matched(case: Case) -> Measured:
    return unmatched_keys(case.evidence, f"{BASELINES}/matched.json", case.params.baselines)


def unmatched_keys(evidence: Evidence, path: str, methods: Sequence[str]) -> Measured:
    """Settings in which methods differ although no whitelist allows it.

    Raises:
        MissingEvidenceError: A method is not compared.
    """
    document = evidence.document(path)
    differing, allowed = document.get("differing_keys"), document.get("whitelist")
    if not isinstance(differing, dict) or not isinstance(allowed, list):
        raise MissingEvidenceError(f"{path} has no differing_keys or no whitelist")
    bad = []
    for method in methods:
        if not isinstance(differing.get(method), list):
            raise MissingEvidenceError(f"{path} does not compare {method}")
        bad += [f"{method}.{key}" for key in differing[method] if key not in allowed]
    text = "; ".join(bad) or f"only whitelisted keys differ ({', '.join(map(str, allowed))})"
    return Measured(float(len(bad)), caveat=text)


def _baseline_coverage(case: Case) -> Measured:
    columns = ("seed", "convention", "modes_present", "modes_covered")
    found = []
    for method in case.params.baselines:
        rows = case.evidence.of(f"{BASELINES}/modes.parquet", method, *columns)
        rows = rows[numbers(rows, "modes_present") >= 2]
        if len(rows) == 0:
            raise MissingEvidenceError(f"no two-mode situation was given to {method}")
        share = numbers(rows, "modes_covered") / numbers(rows, "modes_present")
        means = rows.assign(share=share).groupby("convention")["share"].mean()
        found += [(float(value), f"{method}, {name}") for name, value in means.items()]
    best, name = max(found)
    return Measured(best, caveat=f"best of {len(found)} conventions, by {name}")


SPEC = GateSpec(
    gate="A",
    bind=(
        "artifacts/ingest/frames.parquet",
        "artifacts/ingest/episodes.parquet",
        "artifacts/ingest/manifest.json",
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
            _refused_recordings,
            "Data semantics: a recording vanished at ingest; read the refusals.",
        ),
        CriterionSpec(
            "clock_residual_s",
            "Do the clocks of all streams agree after realignment?",
            "<=",
            "perception",
            (f"{AUDIT}/clocks.parquet",),
            _clock_residual,
            "Data semantics: recheck timestamps per stream and epoch before anything else.",
        ),
        CriterionSpec(
            "lag_spread_steps",
            "Is the lag from action to state the same in every epoch?",
            "<=",
            "controller",
            (f"{AUDIT}/clocks.parquet",),
            _lag_spread,
            "Data semantics: actions and states are shifted against each other in some epochs.",
        ),
        CriterionSpec(
            "calibration_residual_m",
            "Are the calibration epochs consistent?",
            "<=",
            "perception",
            (f"{AUDIT}/calibration.parquet",),
            _calibration_residual,
            "Data semantics: an epoch's frames drifted; recalibrate or exclude it by name.",
        ),
        CriterionSpec(
            "label_disagreement",
            "Do outcome labels agree with replay?",
            "<=",
            "model",
            (f"{AUDIT}/replay.parquet",),
            _label_disagreement,
            "Data semantics: failed episodes are labelled successful; correct labels first.",
        ),
        CriterionSpec(
            "held_out_situations",
            "Were enough held-out situations examined?",
            ">=",
            "model",
            (f"{AUDIT}/neighbourhoods.parquet",),
            _held_out_situations,
            "Multimodality: too little support; record more episodes of the same task.",
        ),
        CriterionSpec(
            "multimodal_situations",
            "In how many do two persistent modes exist?",
            ">=",
            "model",
            (f"{AUDIT}/neighbourhoods.parquet",),
            _multimodal_situations,
            "Multimodality: the actions are unimodal here; keep the simpler policy.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "persistence_margin",
            "Does mode identity persist over steps, beyond a shuffled-time null?",
            ">=",
            "model",
            (f"{AUDIT}/persistence.json",),
            _persistence_margin,
            "Multimodality: this is pointwise noise (tremor, quantisation), not a mode.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "mode_success_lower",
            "Does each mode succeed?",
            ">=",
            "model",
            (f"{AUDIT}/modes.parquet",),
            _mode_success,
            "Multimodality: a mode fails; separate failed and intervention targets.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "mode_feasible_share",
            "Is each mode feasible in all layers?",
            ">=",
            "controller",
            (f"{AUDIT}/modes.parquet",),
            _mode_feasible,
            "Multimodality: a mode breaks limits or collides; it is no valid target.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "mean_defeated_share",
            "Is the mean rejected where every mode passes?",
            ">=",
            "model",
            (f"{AUDIT}/neighbourhoods.parquet",),
            _mean_defeated,
            "Multimodality: the mean action is admissible, so a point policy loses nothing.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "recovery_benefit",
            "Does a mode matter for recovery?",
            ">=",
            "model",
            (f"{AUDIT}/recovery.parquet",),
            _recovery_benefit,
            "Multimodality: no mode is better at recovering.",
            route="recovery",
        ),
        CriterionSpec(
            "strata_effect",
            "Does phase, object, operator or epoch explain the modes?",
            "<=",
            "perception",
            (f"{AUDIT}/strata.parquet",),
            _strata_effect,
            "Conditioning: a recorded variable explains the modes; give it to the policy.",
        ),
        CriterionSpec(
            "cause_accepted",
            "Does the audit attribute the modes to the task itself?",
            ">=",
            "model",
            (f"{AUDIT}/summary.json",),
            _cause_accepted,
            "Conditioning: the audit found another cause than valid modes; remove it first.",
            route=VALID_CAUSE,
        ),
        CriterionSpec(
            "baselines_matched",
            "Are BC, chunked BC and ACT frozen under one configuration?",
            "<=",
            "model",
            (f"{BASELINES}/matched.json",),
            _baselines_matched,
            "Baselines: configurations differ in more than the head; retrain them matched.",
        ),
        CriterionSpec(
            "baseline_mode_coverage",
            "Does the best simple policy lose modes?",
            "<=",
            "model",
            (f"{BASELINES}/modes.parquet",),
            _baseline_coverage,
            "Baselines: a simple policy already covers the modes; keep it.",
        ),
    ),
)
