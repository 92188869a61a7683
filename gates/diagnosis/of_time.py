"""Looks at time: how chunks join, how old the queue is, what an answer takes from end to end."""

import math
from collections.abc import Collection, Mapping

import pandas as pd

from gates.diagnosis.looking import Interval, Look, p95_of
from gates.evidence import MissingEvidenceError, numbers
from gates.report import Answer
from gates.reproducibility.latency_budget import LATENCY, Budget, Spans, budget_of
from gates.stress.rollouts import ROLLOUTS, STRESS
from gates.words import duration, length, span
from genpolicy.contract.planner import PLANNER
from genpolicy.evidence.rows.reproducibility import LatencyRow
from genpolicy.evidence.rows.stress import RolloutRow, SpliceRow, StressCountRow

SPLICES = f"{STRESS}/splices.parquet"
COUNTS = f"{STRESS}/counts.parquet"
WARM = "warm"
SAMPLING = "sample"
"""The term of latency that a microbenchmark of samplers looks at."""
ONE_HORIZON = "what another H_e or re-planning would do: both are fixed, and varied in no rollout"
FURTHER = 2.0
"""From this ratio on a jump speaks: no criterion limits jumps in motion, and methods differ a bit
in speed."""


def chunks_joining(look: Look) -> None:
    """Is the jump one of the execution horizon, of re-planning or of blending?"""
    look.shown("C.boundary_jerk_p95_m_s3")
    look.ask(_horizons)
    look.ask(_jumps)
    look.ask(_discards)
    look.unknown.append(ONE_HORIZON)


def normalisation_and_queue(look: Look) -> None:
    """Do normalisations differ, or are the actions in the queue old?"""
    look.criteria(
        "B.unmatched_keys", "B.unpinned_items", "B.metadata_mismatches", "C.stub_stale",
        "D.latency_p95_s", "D.deadline_miss_upper", "D.hold_share_upper",
    )  # fmt: skip
    look.ask(ages)


def whole_accounting(look: Look) -> None:
    """Are preprocessing, projection and queue in the account, or sampling alone?"""
    look.criteria("B.latency_terms_missing", "B.latency_model_ratio_upper")
    look.ask(_on_the_bench)
    look.ask(declared_terms)


def rejections_and_p95(look: Look) -> None:
    """Do rejections, redraws and slow answers take back what sampling gains?"""
    look.criteria("D.latency_p95_s", "D.deadline_miss_upper", "D.rejection_share_upper")
    look.ask(_in_motion)


def ages(look: Look) -> None:
    """Ages of accepted actions, in the condition where they are oldest."""
    rows = look.rows("D", ROLLOUTS, RolloutRow)
    rows = rows[rows["action_age_p95_s"].notna()]
    if len(rows) == 0:
        raise MissingEvidenceError(f"{ROLLOUTS}: no action of {look.candidate} was accepted")
    oldest = rows.assign(age_s=numbers(rows, "action_age_p95_s")).groupby("perturbation")["age_s"]
    worst = str(oldest.max().idxmax())
    part = rows[rows["perturbation"] == worst]
    look.number(
        f"age of accepted actions where it is largest, {worst}",
        f"p95 of a rollout at most {duration(part['action_age_p95_s'].max())}, oldest "
        f"{duration(part['action_age_max_s'].max())}",
        f"{part['start'].nunique()} starts",
        f"{ROLLOUTS}: action_age_p95_s, action_age_max_s",
    )


def declared_terms(look: Look) -> None:
    """Terms of latency that nobody measured."""
    rows = look.rows("B", LATENCY, LatencyRow)
    measured = set(rows.loc[rows["source"] == "measured", "component"].astype(str))
    declared = sorted(set(rows["component"].astype(str)) - measured)
    if declared:
        look.unknown.append(
            f"{LATENCY}: {', '.join(declared)} are declared and not measured; no machine here has "
            "that camera, bus or network"
        )


def _horizons(look: Look) -> None:
    look.rows("D", SPLICES, SpliceRow)
    settings = look.reports.settings("D")
    look.number(
        "actions executed of a chunk, and their period",
        f"H_e {settings.execution_horizon}, {duration(settings.action_period_s)}",
        "", "params.yaml: horizons",
    )  # fmt: skip


def _jumps(look: Look) -> None:
    """The way from the last command to the first row that was due, as proposed and as admitted."""
    settings = look.reports.settings("D")
    own = look.rows("D", SPLICES, SpliceRow)
    raw = _p95(look, own, "raw_jump_m", "as proposed", look.candidate)
    admitted = _p95(look, own, "jump_m", f"as admitted, joined by {_rules(own)}", look.candidate)
    if admitted[0] > FURTHER * raw[1]:
        look.causes.append(
            f"joining or projection makes the jump: as proposed {_lengths(raw)}, as admitted "
            f"{_lengths(admitted)}."
        )
    every = look.rows("D", SPLICES, SpliceRow, all_methods=True)
    simple = {
        name: _p95(look, every[every["method"] == name], "raw_jump_m", "as proposed", name)
        for name in settings.baselines
        # A planner begins where it sees the arm, which lies behind what was commanded last.
        if name != PLANNER and (every["method"] == name).any()
    }
    if not simple:
        raise MissingEvidenceError(f"{SPLICES} has no simple policy to compare with")
    widest = max(simple, key=lambda name: simple[name][1])
    if raw[0] > FURTHER * simple[widest][1]:
        look.causes.append(
            "successive plans disagree before anything joins them: as proposed "
            f"{_lengths(raw)}, of the simple policies at most {_lengths(simple[widest])} "
            f"({widest})."
        )


def _p95(look: Look, rows: pd.DataFrame, column: str, what: str, method: str) -> Interval:
    settings = look.reports.settings("D")
    values = rows.assign(value=numbers(rows, column))
    point, ends = p95_of(
        values["value"], values["start"], confidence=settings.confidence,
        rng=settings.draws("diagnosis", column, method),
    )  # fmt: skip
    look.number(
        f"p95 of the jump at a boundary of {method}, {what}",
        f"{length(point)} ({_lengths(ends)})",
        f"{values['start'].nunique()} starts, {len(values)} boundaries",
        f"{SPLICES}: {column}",
    )
    return ends


def _rules(rows: pd.DataFrame) -> str:
    return ", ".join(sorted(set(rows["rule"].astype(str))))


def _discards(look: Look) -> None:
    rows = look.rows("D", COUNTS, StressCountRow)
    by_reason = rows.assign(count=numbers(rows, "count")).groupby("reason")["count"].sum()
    said = ", ".join(f"{reason or 'none'} {count:g}" for reason, count in by_reason.items())
    conditions = f"{rows['perturbation'].nunique()} conditions"
    look.number("actions discarded before their turn", said, conditions, f"{COUNTS}: count")


def _budgets(look: Look) -> dict[str, Budget]:
    """What a warm invocation of each candidate takes, term by term."""
    frame = look.rows("B", LATENCY, LatencyRow, all_methods=True)
    confidence = look.reports.settings("B").confidence
    own = frame[frame["method"].isin(look.reports.candidates)]
    budgets = {
        str(name): budget_of(part, WARM, confidence=confidence)
        for name, part in own.groupby("method", sort=True)
    }
    if look.candidate not in budgets:
        raise MissingEvidenceError(f"{LATENCY} has no rows of {look.candidate}")
    return budgets


def _soonest(budgets: Mapping[str, Budget]) -> str:
    """Who wins the microbenchmark: the shortest median of sampling alone."""
    return min(budgets, key=lambda name: budgets[name].terms[SAMPLING].p50[0])


def _is_alone(look: Look, timed: Collection[str]) -> bool:
    """Whether there is nobody to compare with, which is said: alone, nobody is the slower one."""
    if len(timed) > 1:
        return False
    look.unknown.append(f"whether anybody is through sooner: {look.candidate} alone was timed")
    return True


def _on_the_bench(look: Look) -> None:
    """Sampling alone against whole invocations, of every candidate that was timed."""
    budgets = _budgets(look)
    for name, budget in budgets.items():
        counted = f"{budget.end_to_end.n} warm invocations"
        where = f"{LATENCY}: seconds, {WARM}"
        look.number(f"sampling alone, {name}", _spans(budget.terms[SAMPLING]), counted, where)
        look.number(f"all eleven terms, {name}", _spans(budget.end_to_end), counted, where)
    if _is_alone(look, budgets) or _soonest(budgets) != look.candidate:
        return
    mine = budgets[look.candidate].end_to_end.p50
    for name, other in budgets.items():
        if mine[1] > other.end_to_end.p50[2]:
            look.causes.append(
                f"{look.candidate} samples soonest and {name} is through sooner: median of all "
                f"terms {duration(mine[0])} against {duration(other.end_to_end.p50[0])}."
            )


def _in_motion(look: Look) -> None:
    """The same order of answers in closed loop, where every candidate and check is paid for."""
    ends = {}
    for name in look.reports.candidates:
        found = look.reports.answer("D.latency_p95_s", name)
        if isinstance(found, Answer) and found.interval is not None:
            ends[name] = found.interval
    if look.candidate not in ends:
        raise MissingEvidenceError(f"the closed-loop latency of {look.candidate} has no interval")
    rows = look.rows("D", ROLLOUTS, RolloutRow, all_methods=True)
    for name in ends:
        own = rows[rows["method"] == name]
        refused, asked = numbers(own, "rejections").sum(), numbers(own, "invocations").sum()
        look.number(
            f"answers refused whole and drawn again, {name}", f"{refused:g} of {asked:g}",
            f"{own['start'].nunique()} starts", f"{ROLLOUTS}: rejections, invocations",
        )  # fmt: skip
    if _is_alone(look, ends) or _soonest(_budgets(look)) != look.candidate:
        return
    for name, other in ends.items():
        if ends[look.candidate][0] > other[1]:
            look.causes.append(
                f"{look.candidate} samples soonest, and in motion {name} answers sooner: p95 "
                f"{_durations(other)} against {_durations(ends[look.candidate])}."
            )


def _spans(spans: Spans) -> str:
    low, high = spans.p95[1:]
    return f"p50 {duration(spans.p50[0])}, p95 {duration(spans.p95[0])} ({_durations((low, high))})"


def _lengths(ends: Interval) -> str:
    return span(length(ends[0]), length(ends[1]))


def _durations(ends: Interval) -> str:
    """From when to when; so few measurements may bound no upper end, which is open then."""
    if math.isinf(ends[1]):
        return f"{duration(ends[0])} to open"
    return span(duration(ends[0]), duration(ends[1]))
