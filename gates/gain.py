"""What Gate D measures: matched starts, the paired gain, and what it costs.

All conditions and training seeds of one start are averaged: the start is the unit of
independence of the paired test and of the success bounds.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from gates.bounds import counted_interval, share_interval, upper_quantile
from gates.engine import Case, Measured
from gates.evidence import Array, Evidence, MissingEvidenceError, flags, number, numbers
from gates.gate_c import checker
from genpolicy.statistics.eprocess import paired_e_value

STRESS = "artifacts/stress"
ROLLOUTS = f"{STRESS}/rollouts.parquet"
NOMINAL = "nominal"


def best_baseline(evidence: Evidence, params: Any) -> str:
    """The simple method with the highest success over all planned conditions.

    Raises:
        MissingEvidenceError: A baseline was not run.
    """
    means: dict[str, float] = {}
    for method in params.baselines:
        rows = evidence.of(ROLLOUTS, method, "perturbation", "success")
        rows = rows[rows["perturbation"].isin(params.perturbations)]
        means[method] = float(np.mean(flags(rows, "success"))) if len(rows) else 0.0
    order = list(means)
    return min(order, key=lambda name: (-means[name], order.index(name)))


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


def unmatched_starts(case: Case) -> Measured:
    """Starts, by hash of the state after reset, that the candidate and a baseline do not share."""
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


def promotion(case: Case) -> Measured:
    """Lowest evidence, over the baselines, that the gain exceeds the margin (e-value)."""
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


def nominal_success(case: Case) -> Measured:
    """Lower bound of success without perturbation."""
    return _success(case, (NOMINAL,))


def stress_success(case: Case) -> Measured:
    """Lowest lower bound of success over the perturbations."""
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


def deadline_miss(case: Case) -> Measured:
    """Upper bound of the share of invocations that miss their deadline."""
    return _share_of(case, "deadline_misses", "invocations")


def fallback(case: Case) -> Measured:
    """Upper bound of the share of ticks driven by the fallback."""
    return _share_of(case, "fallback_ticks", "ticks")


def intervention(case: Case) -> Measured:
    """Upper bound of the share of rollouts in which a person had to step in."""
    rows = _rows(case, case.candidate, "interventions")
    share, lower, upper = share_interval(
        numbers(rows, "interventions") > 0,
        [f"{c}/{s}" for c, s in zip(rows["perturbation"], rows["start"], strict=True)],
        confidence=case.params.confidence,
        favourable=False,
    )
    return Measured(upper, (lower, upper), f"share {share:.4g} of {len(rows)} rollouts")


def action_age(case: Case) -> Measured:
    """Age that 95 % of the rollouts keep with their own 95 % quantile, s."""
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


def force_peak(case: Case) -> Measured:
    """Peak contact force that 95 % of the rollouts keep, N."""
    rows = _rows(case, case.candidate, "force_peak_n")
    values = numbers(rows, "force_peak_n")
    point, interval = upper_quantile(values, 0.95, confidence=case.params.confidence)
    return Measured(point, interval, f"{len(rows)} rollouts, largest {values.max():.4g} N")


def stub_violations(case: Case) -> Measured:
    """Stale or invalid actions that arrived at the controller stub."""
    columns = ("arrivals", "stale", "invalid")
    rows = case.evidence.of(f"{STRESS}/stub.parquet", case.candidate, *columns)
    arrivals = float(numbers(rows, "arrivals").sum())
    if arrivals <= 0:
        raise MissingEvidenceError("nothing arrived at the stub")
    bad = float(numbers(rows, "stale").sum() + numbers(rows, "invalid").sum())
    return Measured(bad, caveat=f"stale or invalid, of {arrivals:g} arrivals")


def conservation(case: Case) -> Measured:
    """Actions unaccounted for: generated - executed - discarded - queued, and by reason."""
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


def checker_violations(case: Case) -> Measured:
    """Violations that the independent checker found in the journals."""
    return checker(case, f"{STRESS}/checker.json")


def verdict_reachable(case: Case) -> Measured:
    """1 if the pre-registered test reaches both verdicts often enough, else 0."""
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
