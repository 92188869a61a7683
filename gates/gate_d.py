"""Gate D, matched simulation and stress: is the gain larger than its cost?

Each candidate meets every simple baseline on identical starts. The paired test and its margin
are fixed before the run; the cost criteria (deadlines, age, fallback, intervention, force) must
hold together with it.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import Field

from gates.bounds import counted_interval, share_interval, upper_quantile
from gates.engine import Case, CriterionSpec, GateSpec, Measured, judge_gate, standing
from gates.evidence import Array, Evidence, MissingEvidenceError, flags, number, numbers
from gates.gate_c import checker
from gates.models import Criterion, GateReport, StrictModel, Threshold, Verdict
from genpolicy.errors import ConfigError
from genpolicy.statistics.eprocess import paired_e_value

STRESS = "artifacts/stress"
ROLLOUTS = f"{STRESS}/rollouts.parquet"
NOMINAL = "nominal"


class Params(StrictModel):
    """Settings of Gate D other than thresholds; all are fixed before the run.

    Attributes:
        confidence: Coverage of every interval.
        candidates: Methods that stand for promotion.
        baselines: Simpler methods; a candidate must beat each of them.
        perturbations: Conditions that every method must have met; `nominal` is one.
        margin: Gain in success share to be shown.
        alpha: Probability of a wrong promotion, per candidate.
        planned_starts: Starts planned; fewer recorded ones leave the gate without a verdict.
        minimum_power: Share of simulated trials in which each verdict must be reached.
    """

    confidence: float = Field(default=0.95, gt=0.5, lt=1.0)
    candidates: tuple[str, ...]
    baselines: tuple[str, ...] = ("bc", "chunked_bc", "act")
    perturbations: tuple[str, ...]
    margin: float = Field(gt=-1.0, lt=1.0)
    alpha: float = Field(gt=0.0, lt=0.5)
    planned_starts: int = Field(gt=0)
    minimum_power: float = Field(default=0.8, gt=0.0, le=1.0)


def judge(root: Path, thresholds: Mapping[str, Threshold], params: Params) -> GateReport:
    """Report of Gate D from the evidence below `root`; only methods that passed C stand.

    Raises:
        ConfigError: A threshold of no criterion, or one that contradicts the settings.
        IntegrityError: Evidence that is not what it claims to be.
    """
    _check_settings(thresholds, params)
    names, caveats = standing(root, "C", params.candidates)
    evidence = Evidence(root)

    def decision(
        criteria: Sequence[Criterion], verdict: Verdict, verdicts: dict[str, Verdict]
    ) -> str:
        return _decide(evidence, params, criteria, verdict, verdicts)

    return judge_gate(
        SPEC, evidence, thresholds, params, candidates=names, caveats=caveats, decision=decision
    )


def _check_settings(thresholds: Mapping[str, Threshold], params: Params) -> None:
    test = thresholds.get("promotion_e_value")
    needed = 1.0 / params.alpha
    if test is not None and test.limit < needed * (1.0 - 1e-9):
        raise ConfigError(
            where="params.yaml: gate_d.thresholds.promotion_e_value.limit",
            found=f"{test.limit:g}",
            expected=f"at least 1 / alpha = {needed:g}",
            action="Set the limit from alpha; a lower one promotes wrongly too often.",
        )
    if NOMINAL not in params.perturbations or len(params.perturbations) < 2:
        raise ConfigError(
            where="params.yaml: gate_d.perturbations",
            found=", ".join(params.perturbations) or "empty",
            expected=f"{NOMINAL} and at least one more",
            action="List the conditions of the stress stage.",
        )


def _decide(
    evidence: Evidence,
    params: Params,
    criteria: Sequence[Criterion],
    verdict: Verdict,
    verdicts: dict[str, Verdict],
) -> str:
    if verdict == "INCONCLUSIVE":
        return "No decision: complete the evidence, then judge again."
    if verdict == "PASS":
        values = {
            c.candidate: c.measured if c.measured is not None else -math.inf
            for c in criteria
            if c.id == "promotion_e_value" and c.candidate
        }
        passed = sorted(
            (name for name, one in verdicts.items() if one == "PASS"),
            key=lambda name: (-values.get(name, -math.inf), name),
        )
        return f"promote {passed[0]}"
    try:
        return f"return to {best_baseline(evidence, params)}"
    except MissingEvidenceError as error:
        return f"return to the simpler policy ({error})"


def best_baseline(evidence: Evidence, params: Params) -> str:
    """The simple method with the highest success over all planned conditions.

    Raises:
        MissingEvidenceError: A baseline was not run.
    """
    means = {}
    for method in params.baselines:
        rows = evidence.of(ROLLOUTS, method, "perturbation", "success")
        rows = rows[rows["perturbation"].isin(params.perturbations)]
        means[method] = float(np.mean(flags(rows, "success"))) if len(rows) else 0.0
    return min(means, key=lambda name: (-means[name], params.baselines.index(name)))


def _rows(case: Case, method: str, *columns: str) -> pd.DataFrame:
    rows = case.evidence.of(ROLLOUTS, method, "perturbation", "start", *columns)
    rows = rows[rows["perturbation"].isin(case.params.perturbations)]
    absent = sorted(set(case.params.perturbations) - set(rows["perturbation"]))
    if absent:
        raise MissingEvidenceError(f"{method} did not meet {', '.join(absent)}")
    per_condition = rows.groupby("perturbation")["start"].nunique()
    if int(per_condition.min()) < case.params.planned_starts:
        raise MissingEvidenceError(
            f"{method} has {int(per_condition.min())} starts in {per_condition.idxmin()}, "
            f"planned {case.params.planned_starts}"
        )
    return rows


def _starts(case: Case, method: str) -> set[tuple[str, int, str]]:
    rows = _rows(case, method, "start_sha256", "seed")
    if rows[["seed", "perturbation", "start"]].duplicated().any():
        raise MissingEvidenceError(f"{method} has two rows of one seed, condition and start")
    if rows["start_sha256"].fillna("").astype(str).eq("").any():
        raise MissingEvidenceError(f"{method} has a start without hash")
    return set(zip(rows["perturbation"], rows["start"], rows["start_sha256"], strict=True))


def _unmatched_starts(case: Case) -> Measured:
    own = _starts(case, case.candidate)
    unmatched = {name: len(own ^ _starts(case, name)) for name in case.params.baselines}
    text = f"{len(own)} starts by state hash; " + ", ".join(
        f"{name} {n}" for name, n in unmatched.items()
    )
    return Measured(float(sum(unmatched.values())), caveat=text)


def success_by_start(case: Case, method: str) -> "pd.Series[float]":
    """Mean success of a method per start, over conditions and training seeds, in start order."""
    rows = _rows(case, method, "success")
    if rows["success"].isna().any():
        raise MissingEvidenceError(f"{method} has a rollout without outcome")
    rows = rows.assign(success=flags(rows, "success").astype(np.float64))
    means = rows.groupby(["start", "perturbation"])["success"].mean()
    return means.groupby("start").mean().sort_index()


def paired_differences(case: Case, method: str, baseline: str) -> Array:
    """Success of `method` minus that of `baseline`, per start. Shape (planned_starts,).

    All conditions and seeds of a start are one draw, so that the pairs are independent.
    """
    own, other = success_by_start(case, method), success_by_start(case, baseline)
    common = own.index.intersection(other.index)[: case.params.planned_starts]
    if len(common) < case.params.planned_starts:
        raise MissingEvidenceError(f"only {len(common)} starts are shared with {baseline}")
    return np.asarray(own[common].to_numpy() - other[common].to_numpy(), dtype=np.float64)


def _promotion(case: Case) -> Measured:
    found = []
    for baseline in case.params.baselines:
        differences = paired_differences(case, case.candidate, baseline)
        test = paired_e_value(differences, margin=case.params.margin, alpha=case.params.alpha)
        found.append((float(test.e_value), baseline, float(differences.mean())))
    value, baseline, gain = min(found)
    text = (
        f"lowest over baselines, against {baseline}: mean gain {gain:.4g} over "
        f"{case.params.planned_starts} starts, margin {case.params.margin:g}"
    )
    return Measured(value, caveat=text)


def _success(case: Case, conditions: Sequence[str]) -> Measured:
    rows = _rows(case, case.candidate, "success")
    if rows["success"].isna().any():
        raise MissingEvidenceError("a rollout has no outcome")
    found = []
    for condition in conditions:
        part = rows[rows["perturbation"] == condition]
        share, lower, upper = share_interval(
            flags(part, "success"),
            part["start"].to_numpy(),
            confidence=case.params.confidence,
            favourable=True,
        )
        found.append((lower, upper, share, condition, part["start"].nunique()))
    lower, upper, share, condition, starts = min(found)
    text = f"{condition}: share {share:.4g}, lower bound over {starts} starts"
    return Measured(lower, (lower, upper), text)


def _nominal_success(case: Case) -> Measured:
    return _success(case, (NOMINAL,))


def _stress_success(case: Case) -> Measured:
    return _success(case, [name for name in case.params.perturbations if name != NOMINAL])


def _share_of(case: Case, part: str, whole: str) -> Measured:
    """Upper bound of a share of ticks; the unit of independence is the rollout."""
    rows = _rows(case, case.candidate, part, whole)
    hits, all_of = numbers(rows, part), numbers(rows, whole)
    if all_of.sum() <= 0 or np.any(hits > all_of) or np.any(hits < 0):
        raise MissingEvidenceError(f"{part} is no part of {whole}")
    share, trials = float(hits.sum() / all_of.sum()), len(rows)
    bad = math.ceil(round(share * trials, 9))
    interval = counted_interval(bad, trials, confidence=case.params.confidence)
    ratios = rows.assign(hits=hits, whole=all_of).groupby("perturbation")[["hits", "whole"]].sum()
    worst = ratios["hits"] / ratios["whole"]
    text = (
        f"share {share:.4g}, worst in {worst.idxmax()} at {float(worst.max()):.4g}; "
        f"upper bound over {trials} rollouts"
    )
    return Measured(interval[1], interval, text)


def _deadline_miss(case: Case) -> Measured:
    return _share_of(case, "deadline_misses", "invocations")


def _fallback(case: Case) -> Measured:
    return _share_of(case, "fallback_ticks", "ticks")


def _intervention(case: Case) -> Measured:
    rows = _rows(case, case.candidate, "interventions")
    share, lower, upper = share_interval(
        numbers(rows, "interventions") > 0,
        [f"{c}/{s}" for c, s in zip(rows["perturbation"], rows["start"], strict=True)],
        confidence=case.params.confidence,
        favourable=False,
    )
    return Measured(upper, (lower, upper), f"share {share:.4g} of {len(rows)} rollouts")


def _action_age(case: Case) -> Measured:
    rows = _rows(case, case.candidate, "action_age_p95_s", "action_ticks")
    acted = rows[numbers(rows, "action_ticks") > 0]
    ages = numbers(acted, "action_age_p95_s")
    if np.any(ages < 0):
        raise MissingEvidenceError("an action age is negative: the clocks are wrong")
    point, interval = upper_quantile(ages, 0.95, confidence=case.params.confidence)
    text = f"95 % of {len(acted)} rollouts keep their own p95 below this"
    if len(acted) < len(rows):
        text += f"; {len(rows) - len(acted)} rollouts executed no action of the policy"
    return Measured(point, interval, text)


def _force_peak(case: Case) -> Measured:
    rows = _rows(case, case.candidate, "force_peak_n")
    values = numbers(rows, "force_peak_n")
    point, interval = upper_quantile(values, 0.95, confidence=case.params.confidence)
    return Measured(point, interval, f"{len(rows)} rollouts, largest {values.max():.4g} N")


def _stub_violations(case: Case) -> Measured:
    columns = ("arrivals", "stale", "invalid")
    rows = case.evidence.of(f"{STRESS}/stub.parquet", case.candidate, *columns)
    arrivals = float(numbers(rows, "arrivals").sum())
    if arrivals <= 0:
        raise MissingEvidenceError("nothing arrived at the stub")
    bad = float(numbers(rows, "stale").sum() + numbers(rows, "invalid").sum())
    return Measured(bad, caveat=f"stale or invalid, of {arrivals:g} arrivals")


def _conservation(case: Case) -> Measured:
    names = ("generated", "executed", "discarded", "queued")
    path = f"{STRESS}/conservation.parquet"
    rows = case.evidence.of(path, case.candidate, "perturbation", *names)
    generated, executed, discarded, queued = (numbers(rows, name) for name in names)
    if generated.sum() <= 0:
        raise MissingEvidenceError("nothing was generated")
    error = float(np.abs(generated - executed - discarded - queued).sum())
    reasons = case.evidence.of(f"{STRESS}/counts.parquet", case.candidate, "perturbation", "count")
    by_reason = (
        reasons.assign(count=numbers(reasons, "count")).groupby("perturbation")["count"].sum()
    )
    stated = rows.assign(discarded=discarded).groupby("perturbation")["discarded"].sum()
    error += float(stated.sub(by_reason, fill_value=0.0).abs().sum())
    return Measured(error, caveat="generated = executed + discarded by reason + still queued")


def _checker_violations(case: Case) -> Measured:
    return checker(case, f"{STRESS}/checker.json")


def _verdict_reachable(case: Case) -> Measured:
    document = case.evidence.document(f"{STRESS}/power.json")
    params = case.params
    stated = {"margin": params.margin, "alpha": params.alpha, "pairs": params.planned_starts}
    for key, value in stated.items():
        if not math.isclose(number(document, key), value, rel_tol=1e-9):
            raise MissingEvidenceError(f"the power table is for another {key}")
    rows: Any = document.get("rows")
    if not isinstance(rows, list) or not rows:
        raise MissingEvidenceError("the power table has no rows")
    promote = max(number(row, "promote_share") for row in rows)
    back = max(number(row, "return_share") for row in rows)
    reachable = min(promote, back) >= params.minimum_power
    text = f"promote reached in {promote:.3g} of simulated trials, return in {back:.3g}"
    return Measured(float(reachable), caveat=text)


SPEC = GateSpec(
    gate="D",
    bind=(f"{STRESS}/journals/*.mcap",),
    back_to="the simpler policy",
    go_on="Draft the trial card.",
    caveats=(
        "Simulation: contact, sensing and delays are models; nothing here was seen on hardware.",
        "Starts are the unit of independence; conditions and seeds of one start are averaged.",
        "Only methods matched in data, encoder, horizons, resets and deadlines are compared.",
    ),
    criteria=(
        CriterionSpec(
            "unmatched_starts",
            "Did all methods begin from identical states?",
            "<=",
            "model",
            (ROLLOUTS,),
            _unmatched_starts,
            "Evaluator: starts differ, so the methods cannot be compared; fix the resets.",
            per_candidate=True,
        ),
        CriterionSpec(
            "verdict_reachable",
            "Could the test have come out either way at this size?",
            ">=",
            "model",
            (f"{STRESS}/power.json",),
            _verdict_reachable,
            "Evaluator: too few starts for this margin; plan more before looking at results.",
        ),
        CriterionSpec(
            "nominal_success_lower",
            "Does it succeed undisturbed?",
            ">=",
            "model",
            (ROLLOUTS,),
            _nominal_success,
            "Generator training: it fails undisturbed; look at samples before stress.",
            per_candidate=True,
        ),
        CriterionSpec(
            "deadline_miss_upper",
            "How often does it miss its deadline?",
            "<=",
            "controller",
            (ROLLOUTS,),
            _deadline_miss,
            "Timing: the sampler is too slow for the period; fewer NFE, or prefetch.",
            per_candidate=True,
        ),
        CriterionSpec(
            "action_age_p95_s",
            "How old are the observations behind the actions?",
            "<=",
            "perception",
            (ROLLOUTS,),
            _action_age,
            "Timing: look at queue, replacement and camera delay.",
            per_candidate=True,
        ),
        CriterionSpec(
            "fallback_share_upper",
            "What share of time does the fallback drive?",
            "<=",
            "safety",
            (ROLLOUTS,),
            _fallback,
            "Timing: the fallback does the work; read discards by reason.",
            per_candidate=True,
        ),
        CriterionSpec(
            "intervention_upper",
            "How often must a person step in?",
            "<=",
            "safety",
            (ROLLOUTS,),
            _intervention,
            "Feasibility: recovery ends at a person too often; read recovery by phase.",
            per_candidate=True,
        ),
        CriterionSpec(
            "stub_violations",
            "How many stale or invalid actions reached the stub?",
            "<=",
            "safety",
            (f"{STRESS}/stub.parquet",),
            _stub_violations,
            "Feasibility: a stale or rejected action reached the controller; stop here.",
            per_candidate=True,
        ),
        CriterionSpec(
            "force_peak_p95_n",
            "How hard does it touch?",
            "<=",
            "safety",
            (ROLLOUTS,),
            _force_peak,
            "Contact controller: look at stale actions and phase transitions, then gains.",
            per_candidate=True,
        ),
        CriterionSpec(
            "stress_success_lower",
            "Does it succeed under the worst perturbation?",
            ">=",
            "model",
            (ROLLOUTS,),
            _stress_success,
            "Timing: see which perturbation breaks it, and its ages and discards.",
            per_candidate=True,
        ),
        CriterionSpec(
            "conservation_error",
            "Is every generated action executed, discarded by reason, or queued?",
            "<=",
            "controller",
            (f"{STRESS}/conservation.parquet", f"{STRESS}/counts.parquet"),
            _conservation,
            "Evaluator: actions vanish or appear; read the counts per perturbation.",
            per_candidate=True,
        ),
        CriterionSpec(
            "checker_violations",
            "What does the independent checker find in the journals?",
            "<=",
            "safety",
            (f"{STRESS}/checker.json",),
            _checker_violations,
            "Evaluator: executor and independent checker disagree; read the violations.",
        ),
        CriterionSpec(
            "promotion_e_value",
            "Is the gain over every simple baseline larger than the margin?",
            ">=",
            "model",
            (ROLLOUTS,),
            _promotion,
            "The gain does not exceed the margin; keep the simpler policy.",
            per_candidate=True,
        ),
    ),
)
