"""Gate C, feasibility and time: does anything invalid or stale ever reach the controller?"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import Field

from gates.bounds import counted_interval, share_interval, upper_quantile
from gates.engine import Case, CriterionSpec, GateSpec, Measured, judge_gate, standing
from gates.evidence import Array, Evidence, MissingEvidenceError, count, flags, number, numbers
from gates.models import GateReport, StrictModel, Threshold

SHADOW = "artifacts/shadow"
CANDIDATES = f"{SHADOW}/candidates.parquet"
LAYERS = ("representation", "kinematic", "geometric", "dynamic", "contact", "fresh")
HELD_OUT = "held_out"


class Params(StrictModel):
    """Settings of Gate C other than thresholds.

    Attributes:
        confidence: Coverage of every interval.
        candidates: Methods that stand for promotion.
        required_fixtures: Corrupted fixtures that must have been tried.
        required_checks: Checks, or layers of checks, each of which must have been disabled once.
        unassigned_modes: Labels of candidates that belong to no mode.
    """

    confidence: float = Field(default=0.95, gt=0.5, lt=1.0)
    candidates: tuple[str, ...]
    required_fixtures: tuple[str, ...] = (
        "stale_observation",
        "infeasible_rotation",
        "collision",
        "phase_change",
        "reordered_chunk",
    )
    required_checks: tuple[str, ...] = LAYERS
    unassigned_modes: tuple[str, ...] = ("", "none", "unassigned", "between")


def judge(root: Path, thresholds: Mapping[str, Threshold], params: Params) -> GateReport:
    """Report of Gate C from the evidence below `root`; only methods that passed B stand.

    Raises:
        ConfigError: A threshold of no criterion.
        IntegrityError: Evidence that is not what it claims to be.
    """
    names, caveats = standing(root, "B", params.candidates)
    return judge_gate(SPEC, Evidence(root), thresholds, params, candidates=names, caveats=caveats)


def _rows(case: Case, *columns: str) -> pd.DataFrame:
    return case.evidence.of(CANDIDATES, case.candidate, "fixture", *LAYERS, *columns)


def _held_out(case: Case, *columns: str) -> pd.DataFrame:
    rows = _rows(case, *columns)
    rows = rows[rows["fixture"] == HELD_OUT]
    if len(rows) == 0:
        raise MissingEvidenceError("no held-out observation was sampled")
    return rows


def admissible(rows: pd.DataFrame) -> Array:
    """1.0 where a candidate passed all six layers; a layer not reached is not passed."""
    passed = np.ones(len(rows), dtype=np.bool_)
    for layer in LAYERS:
        passed &= flags(rows, layer)
    return passed.astype(np.float64)


def _admissible_share(case: Case) -> Measured:
    rows = _held_out(case, "observation")
    share, lower, upper = share_interval(
        admissible(rows),
        rows["observation"].to_numpy(),
        confidence=case.params.confidence,
        favourable=True,
    )
    text = (
        f"share {share:.4g} of {len(rows)} candidates; lower bound over "
        f"{rows['observation'].nunique()} observations"
    )
    return Measured(lower, (lower, upper), text)


def _corrupted_refused(case: Case) -> Measured:
    rows = _rows(case, "first_reason")
    rows = rows[rows["fixture"] != HELD_OUT]
    absent = sorted(set(case.params.required_fixtures) - set(rows["fixture"]))
    if absent:
        raise MissingEvidenceError(f"corrupted fixtures not tried: {', '.join(absent)}")
    named = rows["first_reason"].fillna("").astype(str).str.len().to_numpy() > 0
    refused = (admissible(rows) == 0.0) & named
    interval = counted_interval(
        float(refused.sum()), float(len(rows)), confidence=case.params.confidence
    )
    through = sorted(set(rows.loc[~refused, "fixture"]))
    text = f"{len(rows)} candidates of {rows['fixture'].nunique()} corrupted fixtures" + (
        f"; let through or refused without reason: {', '.join(through)}" if through else ""
    )
    return Measured(float(refused.mean()), interval, text)


def _mode_gap(case: Case) -> Measured:
    rows = _held_out(case, "mode", "observation")
    rows = rows.assign(admissible=admissible(rows), mode=rows["mode"].fillna("").astype(str))
    rows = rows[~rows["mode"].isin(case.params.unassigned_modes)]
    sampled = rows.groupby("observation")["mode"].transform("nunique")
    rows = rows[sampled >= 2]
    shares = rows.groupby("mode")["admissible"].mean()
    if len(shares) < 2:
        raise MissingEvidenceError("no observation was answered in two modes")
    text = ", ".join(f"{mode} {float(share):.4g}" for mode, share in shares.items())
    text += f" over {rows['observation'].nunique()} observations answered in several modes"
    return Measured(float(shares.max() - shares.min()), caveat=text)


def _of_admissible(case: Case, column: str) -> Measured:
    rows = _held_out(case, column)
    rows = rows[admissible(rows) == 1.0]
    if len(rows) == 0:
        raise MissingEvidenceError("no candidate is admissible")
    values = np.abs(numbers(rows, column))
    point, interval = upper_quantile(values, 0.95, confidence=case.params.confidence)
    text = f"{len(rows)} admissible held-out candidates, largest {values.max():.4g}"
    return Measured(point, interval, text)


def _projection(case: Case) -> Measured:
    return _of_admissible(case, "position_change_m")


def _boundary_jerk(case: Case) -> Measured:
    return _of_admissible(case, "boundary_jerk_m_s3")


def _stub(case: Case, column: str) -> tuple[float, float]:
    columns = ("fixture", "arrivals", column)
    rows = case.evidence.of(f"{SHADOW}/stub.parquet", case.candidate, *columns)
    arrivals = float(numbers(rows, "arrivals").sum())
    if arrivals <= 0:
        raise MissingEvidenceError("nothing arrived at the stub")
    return float(numbers(rows, column).sum()), arrivals


def _stub_stale(case: Case) -> Measured:
    bad, arrivals = _stub(case, "stale")
    return Measured(bad, caveat=f"of {arrivals:g} arrivals")


def _stub_invalid(case: Case) -> Measured:
    bad, arrivals = _stub(case, "invalid")
    return Measured(bad, caveat=f"of {arrivals:g} arrivals")


def _stub_violation_upper(case: Case) -> Measured:
    stale, arrivals = _stub(case, "stale")
    bad = min(stale + _stub(case, "invalid")[0], arrivals)
    interval = counted_interval(bad, arrivals, confidence=case.params.confidence)
    return Measured(interval[1], interval, f"{bad:g} of {arrivals:g} arrivals; exact upper bound")


def conservation(frame: pd.DataFrame, keys: list[str]) -> float:
    """Sum over runs of |generated - executed - queued - discarded|.

    Raises:
        MissingEvidenceError: A run states its totals differently in different rows.
    """
    error = 0.0
    for name in ("generated", "executed", "queued", "count"):
        frame = frame.assign(**{name: numbers(frame, name)})
    for run, rows in frame.groupby(keys):
        totals = rows[["generated", "executed", "queued"]].drop_duplicates()
        if len(totals) != 1:
            raise MissingEvidenceError(f"{run} states several totals")
        generated, executed, queued = (float(value) for value in totals.iloc[0])
        error += abs(generated - executed - queued - float(rows["count"].sum()))
    return error


def _conservation(case: Case) -> Measured:
    columns = ("fixture", "generated", "executed", "queued", "reason", "count")
    rows = case.evidence.of(f"{SHADOW}/counts.parquet", case.candidate, *columns)
    error = conservation(rows, ["fixture"])
    if float(rows["generated"].sum()) <= 0:
        raise MissingEvidenceError("nothing was generated")
    return Measured(error, caveat="generated = executed + discarded by reason + still queued")


def checker(case: Case, path: str) -> Measured:
    """Violations that the independent checker found; none counts only if it checked something.

    Raises:
        MissingEvidenceError: It checked nothing.
    """
    document = case.evidence.document(path)
    checked = number(document, "checked_actions")
    if checked <= 0:
        raise MissingEvidenceError("the checker saw no action")
    return Measured(count(document, "violations"), caveat=f"{checked:g} actions re-proved")


def _checker_violations(case: Case) -> Measured:
    return checker(case, f"{SHADOW}/checker.json")


def _mutants_undetected(case: Case) -> Measured:
    entries = case.evidence.listing(f"{SHADOW}/mutants.json")
    silent, covered = [], set()
    for entry in entries:
        if not isinstance(entry, dict) or not isinstance(entry.get("detected"), bool):
            raise MissingEvidenceError("mutants.json has an entry without check or detected")
        covered |= {str(entry.get("check")), str(entry.get("layer"))}
        if not entry["detected"]:
            silent.append(str(entry.get("check")))
    silent += [f"{name} (not tried)" for name in case.params.required_checks if name not in covered]
    text = f"not detected: {', '.join(silent)}" if silent else f"all {len(entries)} detected"
    return Measured(float(len(silent)), caveat=text)


SPEC = GateSpec(
    gate="C",
    bind=(f"{SHADOW}/journal.mcap",),
    back_to="the generator or the projection",
    go_on="Compare every passing candidate with the simpler policies on identical starts.",
    caveats=(
        "Shadow runs execute nothing; closed-loop effects are the matter of gate D.",
        "Corrupted fixtures are those listed; another corruption is not covered.",
    ),
    criteria=(
        CriterionSpec(
            "mode_admissible_gap",
            "Do the checks treat the modes alike, or remove one?",
            "<=",
            "controller",
            (CANDIDATES,),
            _mode_gap,
            "Conditioning: one mode is outside the feasible set; look at raw samples by mode.",
            per_candidate=True,
        ),
        CriterionSpec(
            "admissible_share",
            "What share of held-out candidates passes all six layers?",
            ">=",
            "model",
            (CANDIDATES,),
            _admissible_share,
            "Feasibility: read the rejection waterfall from the first layer down.",
            per_candidate=True,
        ),
        CriterionSpec(
            "projection_p95_m",
            "How far does projection move an admitted chunk?",
            "<=",
            "controller",
            (CANDIDATES,),
            _projection,
            "Feasibility: projection repairs too much; compare raw samples with the limits.",
            per_candidate=True,
        ),
        CriterionSpec(
            "boundary_jerk_p95_m_s3",
            "How hard is the seam between two chunks?",
            "<=",
            "controller",
            (CANDIDATES,),
            _boundary_jerk,
            "Timing: look at H_e, re-planning, blending and normalisation.",
            per_candidate=True,
        ),
        CriterionSpec(
            "corrupted_refused_share",
            "Is every corrupted fixture refused, with a reason?",
            ">=",
            "controller",
            (CANDIDATES,),
            _corrupted_refused,
            "Feasibility: a layer lets a corrupted input through; see which fixture.",
            per_candidate=True,
        ),
        CriterionSpec(
            "stub_stale",
            "How many stale actions arrived at the stub?",
            "<=",
            "safety",
            (f"{SHADOW}/stub.parquet",),
            _stub_stale,
            "Timing: freshness is not enforced before the controller.",
            per_candidate=True,
        ),
        CriterionSpec(
            "stub_invalid",
            "How many invalid actions arrived at the stub?",
            "<=",
            "safety",
            (f"{SHADOW}/stub.parquet",),
            _stub_invalid,
            "Feasibility: something bypasses admission.",
            per_candidate=True,
        ),
        CriterionSpec(
            "stub_violation_upper",
            "How high can the true rate of bad arrivals still be?",
            "<=",
            "safety",
            (f"{SHADOW}/stub.parquet",),
            _stub_violation_upper,
            "Evaluator: too few arrivals for this bound; run more shadow invocations.",
            per_candidate=True,
        ),
        CriterionSpec(
            "conservation_error",
            "Is every generated action executed, discarded by reason, or queued?",
            "<=",
            "controller",
            (f"{SHADOW}/counts.parquet",),
            _conservation,
            "Evaluator: actions vanish or appear; read the counts per fixture.",
            per_candidate=True,
        ),
        CriterionSpec(
            "checker_violations",
            "What does the independent checker find in the journal?",
            "<=",
            "safety",
            (f"{SHADOW}/checker.json",),
            _checker_violations,
            "Evaluator: executor and independent checker disagree; read the violations.",
        ),
        CriterionSpec(
            "mutants_undetected",
            "Does disabling any one check turn the checker red?",
            "<=",
            "safety",
            (f"{SHADOW}/mutants.json",),
            _mutants_undetected,
            "Evaluator: a disabled check goes unnoticed, so its green means nothing.",
        ),
    ),
)
