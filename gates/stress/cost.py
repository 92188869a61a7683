"""The cost: deadlines, ages, fallback, people, force, and what reaches the controller."""

import math

import numpy as np

from gates.bounds import counted_interval, share_interval, upper_quantile
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.feasibility import checked_violations
from gates.stress.rollouts import NOMINAL, STRESS, StressSettings, rollouts, success_lower
from genpolicy.evidence.rows.stress import ConservationRow, StressCountRow, StressStubRow


@criterion(
    "<=",
    question="How often does it miss its deadline?",
    look_at="Timing: the sampler is too slow for the period; fewer NFE, or prefetch.",
    per_candidate=True,
)
def deadline_miss_upper(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the share of invocations that miss their deadline."""
    return _share_of(evidence, settings, candidate, "deadline_misses", "invocations")


@criterion(
    "<=",
    question="How old are the observations behind the actions?",
    look_at="Timing: look at queue, replacement and camera delay.",
    per_candidate=True,
)
def action_age_p95_s(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Age that 95 % of the rollouts keep with their own 95 % quantile, s."""
    rows = rollouts(evidence, settings, candidate)
    acted = rows[numbers(rows, "action_ticks") > 0]
    ages = numbers(acted, "action_age_p95_s")
    if np.any(ages < 0):
        raise MissingEvidenceError("an action age is negative: the clocks are wrong")
    point, interval = upper_quantile(ages, 0.95, confidence=settings.confidence)
    text = f"95 % of {len(acted)} rollouts keep their own p95 below this"
    if len(acted) < len(rows):
        text += f"; {len(rows) - len(acted)} rollouts executed no action of the policy"
    return Measured(point, interval, text)


@criterion(
    "<=",
    question="What share of time does the fallback drive?",
    look_at="Timing: the fallback does the work; read discards by reason.",
    per_candidate=True,
)
def fallback_share_upper(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the share of ticks driven by the fallback."""
    return _share_of(evidence, settings, candidate, "fallback_ticks", "ticks")


def _share_of(
    evidence: Evidence, settings: StressSettings, candidate: str, part: str, whole: str
) -> Measured:
    """Upper bound of a share of ticks; the unit of independence is the rollout."""
    rows = rollouts(evidence, settings, candidate)
    hits, all_of = numbers(rows, part), numbers(rows, whole)
    if all_of.sum() <= 0 or np.any(hits > all_of) or np.any(hits < 0):
        raise MissingEvidenceError(f"{part} is no part of {whole}")
    share, trials = float(hits.sum() / all_of.sum()), len(rows)
    bad = math.ceil(round(share * trials, 9))
    interval = counted_interval(bad, trials, confidence=settings.confidence)
    ratios = rows.assign(hits=hits, whole=all_of).groupby("perturbation")[["hits", "whole"]].sum()
    worst = ratios["hits"] / ratios["whole"]
    text = (
        f"share {share:.4g}, worst in {worst.idxmax()} at {float(worst.max()):.4g}; "
        f"upper bound over {trials} rollouts"
    )
    return Measured(interval[1], interval, text)


@criterion(
    "<=",
    question="How often must a person step in?",
    look_at="Feasibility: recovery ends at a person too often; read recovery by phase.",
    per_candidate=True,
)
def intervention_upper(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Upper bound of the share of rollouts in which a person had to step in."""
    rows = rollouts(evidence, settings, candidate)
    share, lower, upper = share_interval(
        numbers(rows, "interventions") > 0,
        [f"{c}/{s}" for c, s in zip(rows["perturbation"], rows["start"], strict=True)],
        confidence=settings.confidence,
        favourable=False,
    )
    return Measured(upper, (lower, upper), f"share {share:.4g} of {len(rows)} rollouts")


@criterion(
    "<=",
    question="How many stale or invalid actions reached the stub?",
    look_at="Feasibility: a stale or rejected action reached the controller; stop here.",
    per_candidate=True,
    always=True,
)
def stub_violations(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Stale or invalid actions that arrived at the controller stub."""
    rows = evidence.of(f"{STRESS}/stub.parquet", StressStubRow, candidate)
    arrivals = float(numbers(rows, "arrivals").sum())
    if arrivals <= 0:
        raise MissingEvidenceError("nothing arrived at the stub")
    bad = float(numbers(rows, "stale").sum() + numbers(rows, "invalid").sum())
    return Measured(bad, caveat=f"stale or invalid, of {arrivals:g} arrivals")


@criterion(
    "<=",
    question="How hard does it touch?",
    look_at="Contact controller: look at stale actions and phase transitions, then gains.",
    per_candidate=True,
)
def force_peak_p95_n(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Peak contact force that 95 % of the rollouts keep, N."""
    rows = rollouts(evidence, settings, candidate)
    values = numbers(rows, "force_peak_n")
    point, interval = upper_quantile(values, 0.95, confidence=settings.confidence)
    return Measured(point, interval, f"{len(rows)} rollouts, largest {values.max():.4g} N")


@criterion(
    ">=",
    question="Does it succeed under the worst perturbation?",
    look_at="Timing: see which perturbation breaks it, and its ages and discards.",
    per_candidate=True,
)
def stress_success_lower(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Lowest lower bound of success over the perturbations."""
    conditions = [name for name in settings.perturbations if name != NOMINAL]
    return success_lower(evidence, settings, candidate, conditions)


@criterion(
    "<=",
    question="Is every generated action executed, discarded by reason, or queued?",
    look_at="Evaluator: actions vanish or appear; read the counts per perturbation.",
    per_candidate=True,
    always=True,
)
def conservation_error(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Actions unaccounted for: generated - executed - discarded - queued, and by reason."""
    names = ("generated", "executed", "discarded", "queued")
    path = f"{STRESS}/conservation.parquet"
    rows = evidence.of(path, ConservationRow, candidate)
    generated, executed, discarded, queued = (numbers(rows, name) for name in names)
    if generated.sum() <= 0:
        raise MissingEvidenceError("nothing was generated")
    error = float(np.abs(generated - executed - discarded - queued).sum())
    reasons = evidence.of(f"{STRESS}/counts.parquet", StressCountRow, candidate)
    by_reason = (
        reasons.assign(count=numbers(reasons, "count")).groupby("perturbation")["count"].sum()
    )
    stated = rows.assign(discarded=discarded).groupby("perturbation")["discarded"].sum()
    error += float(stated.sub(by_reason, fill_value=0.0).abs().sum())
    return Measured(error, caveat="generated = executed + discarded by reason + still queued")


@criterion(
    "<=",
    question="What does the independent checker find in the journals?",
    look_at="Evaluator: executor and independent checker disagree; read the violations.",
    always=True,
)
def checker_violations(evidence: Evidence, settings: StressSettings) -> Measured:
    """Violations that the independent checker found in the journals."""
    return checked_violations(evidence, f"{STRESS}/checker.json")
