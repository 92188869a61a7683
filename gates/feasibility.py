"""Gate C, feasibility and time: does anything invalid or stale ever reach the controller?"""

import numpy as np
import pandas as pd
from pydantic import Field

from gates.bounds import counted_interval, share_interval, upper_quantile, widest_gap
from gates.criterion import Measured, criteria_of, criterion
from gates.engine import GateSpec
from gates.evidence import Array, Evidence, MissingEvidenceError, count, flags, number, numbers
from gates.settings import CandidateSettings
from genpolicy.evidence.rows.shadow import CandidateRow, ShadowCountRow, ShadowStubRow

SHADOW = "artifacts/shadow"
CANDIDATES = f"{SHADOW}/candidates.parquet"
LAYERS = ("representation", "kinematic", "geometric", "dynamic", "contact", "fresh")
HELD_OUT = "held_out"
TWO_MODES = "two_modes"
INTACT = (HELD_OUT, TWO_MODES)


class FeasibilitySettings(CandidateSettings):
    """Settings of Gate C other than limits.

    Attributes:
        required_fixtures: Corrupted fixtures that must have been tried.
        required_checks: Checks, `layer.check`, each of which must have been left out once.
        unassigned_modes: Labels of candidates that belong to no mode.
        mode_observations: Independent observations of every mode without which the modes are not
            compared.
    """

    required_fixtures: tuple[str, ...]
    required_checks: tuple[str, ...]
    unassigned_modes: tuple[str, ...]
    mode_observations: int = Field(ge=2)


def _rows(evidence: Evidence, candidate: str) -> pd.DataFrame:
    return evidence.of(CANDIDATES, CandidateRow, candidate)


def _held_out(evidence: Evidence, candidate: str) -> pd.DataFrame:
    rows = _rows(evidence, candidate)
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


@criterion(
    "<=",
    question="Do the checks treat the modes alike, or remove one?",
    look_at="Conditioning: one mode is outside the feasible set; look at raw samples by mode.",
    per_candidate=True,
)
def mode_admissible_gap(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Upper bound of the largest difference between modes in the share that is admissible."""
    rows = _rows(evidence, candidate)
    rows = rows[rows["fixture"] == TWO_MODES]
    if len(rows) == 0:
        raise MissingEvidenceError("no situation with several modes was sampled")
    rows = rows.assign(
        admissible=admissible(rows),
        mode=rows["mode"].fillna("").astype(str),
        episode=rows["situation"].astype(str).str.rpartition(":")[0],
    )
    rows = rows[~rows["mode"].isin(settings.unassigned_modes)]
    rows = rows[rows.groupby("observation")["mode"].transform("nunique") >= 2]
    by_mode = {str(mode): part for mode, part in rows.groupby("mode")}
    seen = {mode: part["episode"].nunique() for mode, part in by_mode.items()}
    if len(seen) < 2:
        raise MissingEvidenceError("no observation was answered in two modes")
    if min(seen.values()) < settings.mode_observations:
        rare = ", ".join(f"{mode} {count}" for mode, count in seen.items())
        raise MissingEvidenceError(
            f"observations answered in several modes: {rare}; "
            f"at least {settings.mode_observations} of each are needed"
        )
    shares = {m: (p["admissible"].to_numpy(), p["episode"].tolist()) for m, p in by_mode.items()}
    interval, more, less = widest_gap(shares, confidence=settings.confidence)
    text = ", ".join(f"{m} {p['admissible'].mean():.4g} of {seen[m]}" for m, p in by_mode.items())
    text += f" episodes answered in several modes; upper bound of {more} minus {less}"
    return Measured(interval[1], interval, text)


@criterion(
    ">=",
    question="What share of held-out candidates passes all six layers?",
    look_at="Feasibility: read the rejection waterfall from the first layer down.",
    per_candidate=True,
)
def admissible_share(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> Measured:
    """Lower bound of the share of held-out candidates that pass all six layers."""
    rows = _held_out(evidence, candidate)
    share, lower, upper = share_interval(
        admissible(rows),
        rows["observation"].to_numpy(),
        confidence=settings.confidence,
        favourable=True,
    )
    text = (
        f"share {share:.4g} of {len(rows)} candidates; lower bound over "
        f"{rows['observation'].nunique()} observations"
    )
    return Measured(lower, (lower, upper), text)


@criterion(
    "<=",
    question="How far does projection move an admitted chunk?",
    look_at="Feasibility: projection repairs too much; compare raw samples with the limits.",
    per_candidate=True,
)
def projection_p95_m(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> Measured:
    """Upper bound of the move by projection that 95 % of the admissible candidates keep, m."""
    return _of_admissible(evidence, settings, candidate, "position_change_m")


@criterion(
    "<=",
    question="How hard is the boundary between two chunks?",
    look_at="Timing: look at H_e, re-planning, blending and normalisation.",
    per_candidate=True,
)
def boundary_jerk_p95_m_s3(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Upper bound of the jerk at the boundary that 95 % of the admissible keep, m/s^3."""
    return _of_admissible(evidence, settings, candidate, "boundary_jerk_m_s3")


def _of_admissible(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str, column: str
) -> Measured:
    rows = _held_out(evidence, candidate)
    rows = rows[admissible(rows) == 1.0]
    if len(rows) == 0:
        raise MissingEvidenceError("no candidate is admissible")
    values = np.abs(numbers(rows, column))
    point, interval = upper_quantile(
        values,
        rows["observation"].to_numpy(),
        0.95,
        confidence=settings.confidence,
        rng=settings.draws("C", column, candidate),
    )
    text = (
        f"p95 {point:.4g}, largest {values.max():.4g}; {len(rows)} admissible candidates of "
        f"{rows['observation'].nunique()} held-out observations"
    )
    return Measured(interval[1], interval, text)


@criterion(
    ">=",
    question="Is every corrupted fixture refused, with a reason?",
    look_at="Feasibility: a layer lets a corrupted input through; see which fixture.",
    per_candidate=True,
)
def corrupted_refused_share(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Share of corrupted candidates that are refused with a reason."""
    rows = _rows(evidence, candidate)
    rows = rows[~rows["fixture"].isin(INTACT)]
    absent = sorted(set(settings.required_fixtures) - set(rows["fixture"]))
    if absent:
        raise MissingEvidenceError(f"corrupted fixtures not tried: {', '.join(absent)}")
    named = rows["first_reason"].fillna("").astype(str).str.len().to_numpy() > 0
    refused = (admissible(rows) == 0.0) & named
    interval = counted_interval(
        float(refused.sum()), float(len(rows)), confidence=settings.confidence
    )
    through = sorted(set(rows.loc[~refused, "fixture"]))
    text = f"{len(rows)} candidates of {rows['fixture'].nunique()} corrupted fixtures" + (
        f"; let through or refused without reason: {', '.join(through)}" if through else ""
    )
    return Measured(float(refused.mean()), interval, text)


@criterion(
    "<=",
    question="How many stale actions arrived at the stub?",
    look_at="Timing: freshness is not enforced before the controller.",
    per_candidate=True,
    always=True,
)
def stub_stale(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> Measured:
    """Stale actions that arrived at the stub."""
    bad, arrivals = _stub(evidence, candidate, "stale")
    return Measured(bad, caveat=f"of {arrivals:g} arrivals")


def _stub(evidence: Evidence, candidate: str, column: str) -> tuple[float, float]:
    rows = evidence.of(f"{SHADOW}/stub.parquet", ShadowStubRow, candidate)
    arrivals = float(numbers(rows, "arrivals").sum())
    if arrivals <= 0:
        raise MissingEvidenceError("nothing arrived at the stub")
    return float(numbers(rows, column).sum()), arrivals


@criterion(
    "<=",
    question="How many invalid actions arrived at the stub?",
    look_at="Feasibility: something bypasses admission.",
    per_candidate=True,
    always=True,
)
def stub_invalid(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> Measured:
    """Actions of no admitted chunk that arrived at the stub."""
    bad, arrivals = _stub(evidence, candidate, "invalid")
    return Measured(bad, caveat=f"of {arrivals:g} arrivals")


@criterion(
    "<=",
    question="How often can something bad still arrive?",
    look_at="Evaluator: too few observations for this bound; run more shadow invocations.",
    per_candidate=True,
    always=True,
)
def stub_violation_upper(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Exact upper bound of the share of observations after which something bad arrives.

    Actions of one observation arrive or fail together, so the observations are the trials.
    """
    stale, _ = _stub(evidence, candidate, "stale")
    bad = stale + _stub(evidence, candidate, "invalid")[0]
    rows = evidence.of(f"{SHADOW}/stub.parquet", ShadowStubRow, candidate)
    # The same observations are played in every fixture, and deliver at most one chunk in each.
    observations = float(numbers(rows, "delivered").max())
    if observations <= 0:
        raise MissingEvidenceError("no observation delivered a chunk")
    bad = min(bad, observations)
    interval = counted_interval(bad, observations, confidence=settings.confidence)
    limit = settings.limits.of.get("stub_violation_upper")
    if bad == 0 and limit and limit.limit is not None and not interval[1] <= limit.limit:
        raise MissingEvidenceError(
            f"none bad of {observations:g} observations that delivered bounds it by "
            f"{interval[1]:.4g} only"
        )
    text = f"{bad:g} of {observations:g} observations that delivered; exact upper bound"
    return Measured(interval[1], interval, text)


@criterion(
    "<=",
    question="Is every generated action executed, discarded by reason, or queued?",
    look_at="Evaluator: actions vanish or appear; read the counts per fixture.",
    per_candidate=True,
    always=True,
)
def conservation_error(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Actions unaccounted for, over all fixtures."""
    rows = evidence.of(f"{SHADOW}/counts.parquet", ShadowCountRow, candidate)
    error = unaccounted(rows, ["fixture"])
    if float(rows["generated"].sum()) <= 0:
        raise MissingEvidenceError("nothing was generated")
    return Measured(error, caveat="generated = executed + discarded by reason + still queued")


def unaccounted(frame: pd.DataFrame, keys: list[str]) -> float:
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


@criterion(
    "<=",
    question="What does the independent checker find in the journal?",
    look_at="Evaluator: executor and independent checker disagree; read the violations.",
    always=True,
)
def checker_violations(evidence: Evidence, settings: FeasibilitySettings) -> Measured:
    """Violations that the independent checker found in the journal."""
    return checked_violations(evidence, f"{SHADOW}/checker.json")


def checked_violations(evidence: Evidence, path: str) -> Measured:
    """Violations that the independent checker found; none counts only if it proved every action.

    Raises:
        MissingEvidenceError: It checked nothing, or did not prove the motion of what it checked.
    """
    document = evidence.document(path)
    checked = number(document, "checked_actions")
    proved = number(document, "reproved_actions")
    if checked <= 0:
        raise MissingEvidenceError("the checker saw no action")
    if not proved >= checked:
        raise MissingEvidenceError(f"the motion of {proved:g} of {checked:g} actions was proved")
    text = f"{checked:g} actions proved again, their motion by other geometry"
    return Measured(count(document, "violations"), caveat=text)


@criterion(
    "<=",
    question="Does disabling any one check turn the checker red?",
    look_at="Evaluator: a check left out goes unnoticed, so its green means nothing.",
    always=True,
)
def mutants_undetected(evidence: Evidence, settings: FeasibilitySettings) -> Measured:
    """Checks whose absence was not noticed, or that were not tried."""
    entries = evidence.listing(f"{SHADOW}/mutants.json")
    found, excused = dict[str, bool](), dict[str, str]()
    for entry in entries:
        if not isinstance(entry, dict) or not isinstance(entry.get("detected"), bool):
            raise MissingEvidenceError("mutants.json has an entry without check or detected")
        name = f"{entry.get('layer')}.{entry.get('check')}"
        found[name] = found.get(name, True) and entry["detected"]
        if entry.get("not_applicable") and not entry["detected"] and not entry.get("tried"):
            excused[name] = str(entry["not_applicable"])
    silent = [name for name, detected in found.items() if not detected and name not in excused]
    silent += [f"{name} (not tried)" for name in settings.required_checks if name not in found]
    text = f"not detected: {', '.join(silent)}" if silent else f"all {len(found)} detected"
    if excused:
        listed = ", ".join(f"{name} ({reason})" for name, reason in excused.items())
        text += f"; of them not asked of this task: {listed}"
    return Measured(float(len(silent)), caveat=text)


GATE = GateSpec(
    gate="C",
    settings=FeasibilitySettings,
    criteria=criteria_of(globals()),
    bind=(f"{SHADOW}/journal.mcap",),
    back_to="the generator or the projection",
    go_on="Compare every passing candidate with the simpler policies on identical starts.",
    caveats=(
        "Shadow runs execute nothing; closed-loop effects are the matter of gate D.",
        "Corrupted fixtures are those listed; another corruption is not covered.",
    ),
    below="B",
)
