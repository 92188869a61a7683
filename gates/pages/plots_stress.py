"""Figures of Gate D: success per condition, action age, outcomes."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError, flags, numbers
from gates.pages.figures import Plot, colours, in_order, line_looks, markers
from gates.pages.limits import draw_limit
from gates.report import GateReport
from gates.stress.rollouts import ROLLOUTS
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.pages.figures.drawing import (
    BLUE,
    GREEN,
    GREY,
    HATCHES,
    INK,
    ORANGE,
    PURPLE,
    RED,
    SKY,
    TEAL,
    in_milli,
    in_percent,
    new_figure,
)
from genpolicy.statistics.intervals import clopper_pearson

OUTCOMES = {
    "success": GREEN,
    "failed": PURPLE,
    "timeout": ORANGE,
    "intervention": BLUE,
    "force_stop": SKY,
    "stopped": GREY,
    "collision": RED,
    "assisted": TEAL,
}
"""Known outcomes, best first, and that of an arm that a person had, which is none of the policy; a
colour stays with its outcome in every report."""


def _judged(evidence: Evidence, report: GateReport) -> pd.DataFrame:
    """Rollouts of the conditions that are judged; milder and harder ones are a figure of theirs."""
    frame = evidence.rows(ROLLOUTS, RolloutRow)
    return frame[frame["perturbation"].isin(list(report.settings["perturbations"]))]


def _success(evidence: Evidence, report: GateReport) -> Figure:
    frame = _judged(evidence, report)
    methods, conditions = in_order(frame["method"]), sorted(set(frame["perturbation"]))
    conditions.sort(key=lambda name: name != "nominal")
    colour, shape = colours(methods), markers(methods)
    level = float(report.settings["confidence"])
    figure, (axes,) = new_figure(height=1.2 + 0.12 * len(methods) * len(conditions))
    step = 0.8 / len(methods)
    for place in range(1, len(conditions)):
        axes.axhline(place - 0.5, color=GREY, lw=0.6)
    for rank, method in enumerate(methods):
        for place, condition in enumerate(conditions):
            rows = frame[(frame["method"] == method) & (frame["perturbation"] == condition)]
            if len(rows) == 0:
                continue
            hits, height = flags(rows, "success"), place - 0.4 + step * (rank + 0.5)
            low, high = clopper_pearson(int(hits.sum()), len(hits), level)
            axes.hlines(height, low, high, color=colour[method], lw=1.8)
            axes.plot([hits.mean()], [height], shape[method], color=colour[method], ms=4)
        axes.plot([], [], f"{shape[method]}-", color=colour[method], label=method)
    counts = frame.groupby("perturbation").size()
    labels = [f"{name} (n = {int(counts[name]) // len(methods)} each)" for name in conditions]
    axes.set_yticks(np.arange(len(conditions)), labels)
    axes.set_ylim(len(conditions) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.set_xlim(0, 1.02)
    in_percent(axes.xaxis)
    axes.set_xlabel(f"share of successful rollouts, exact {100 * level:g} % interval over rollouts")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _age(evidence: Evidence, report: GateReport) -> Figure:
    frame = _judged(evidence, report)
    frame = frame[numbers(frame, "action_ticks") > 0]
    if len(frame) == 0:
        raise MissingEvidenceError("no rollout executed an action")
    methods = in_order(frame["method"])
    looks = line_looks(methods)
    figure, (axes,) = new_figure(height=2.8)
    for method in methods:
        rows = frame[frame["method"] == method]
        ages = np.sort(numbers(rows, "action_age_p95_s"))
        kept = ages[np.linspace(0, len(ages) - 1, min(len(ages), 200)).astype(int)]
        share = np.linspace(1 / len(kept), 1, len(kept))
        axes.step(
            kept, share, where="post", label=method, markevery=[len(kept) // 2], **looks[method]
        )
    axes.set_ylim(0, 1.12)
    in_percent(axes.yaxis)
    in_milli(axes.xaxis)
    axes.set_xlabel("p95 of the action age in a rollout, ms")
    axes.set_ylabel("share of rollouts")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _outcomes(evidence: Evidence, report: GateReport) -> Figure:
    frame = _judged(evidence, report)
    methods = in_order(frame["method"])
    seen = set(frame["outcome"])
    names = [*(name for name in OUTCOMES if name in seen), *sorted(seen - set(OUTCOMES))]
    figure, (axes,) = new_figure(height=1.0 + 0.32 * len(methods))
    hatches = [*OUTCOMES, *names]
    start = np.zeros(len(methods))
    for name in names:
        shares = np.array(
            [float((frame.loc[frame["method"] == m, "outcome"] == name).mean()) for m in methods]
        )
        axes.barh(
            np.arange(len(methods)),
            shares,
            left=start,
            height=0.6,
            color=OUTCOMES.get(str(name), INK),
            hatch=HATCHES[hatches.index(name) % len(HATCHES)],
            edgecolor="white",
            label=str(name),
        )
        start += shares
    axes.set_yticks(np.arange(len(methods)), methods)
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    in_percent(axes.xaxis)
    axes.set_xlabel("share of rollouts, all conditions")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _force(evidence: Evidence, report: GateReport) -> Figure:
    frame = _judged(evidence, report)
    methods = in_order(frame["method"])
    colour, shape = colours(methods), markers(methods)
    figure, (axes,) = new_figure(height=1.0 + 0.32 * len(methods))
    for place, method in enumerate(methods):
        values = numbers(frame[frame["method"] == method], "force_peak_n")
        low, middle, high = np.quantile(values, [0.05, 0.5, 0.95], method="higher")
        axes.hlines(place, low, high, color=colour[method], lw=4, alpha=0.5)
        axes.plot([middle], [place], shape[method], color=colour[method])
        axes.plot([values.max()], [place], ">", color=colour[method], ms=4)
    axes.set_yticks(np.arange(len(methods)), methods)
    axes.set_ylim(len(methods) - 0.4, -0.6)
    axes.set_xlim(left=0)
    draw_limit(axes, report, "force_peak_p95_n")
    axes.set_xlabel(
        "peak contact force in a rollout, N (dot median, band 5 to 95 %, arrow maximum)"
    )
    return figure


PLOTS = (
    Plot(
        "Success, by condition and method",
        "All methods began from identical states. Point: share of successful rollouts, line: exact "
        "interval as if rollouts were independent. The promotion test is paired by start and "
        "stricter; its e-value stands under Criteria.",
        ROLLOUTS,
        _success,
    ),
    Plot(
        "Action age",
        "How old the observation behind an action is when the controller accepts it: share of "
        "rollouts whose 95th percentile is at most this. No limit: the executor refuses actions "
        "older than its maximum age.",
        ROLLOUTS,
        _age,
    ),
    Plot(
        "How rollouts end",
        "Each rollout ends in one named outcome. Intervention: recovery asked for a person. Force "
        "stop: the supervisor stopped on contact force.",
        ROLLOUTS,
        _outcomes,
    ),
    Plot(
        "Contact force",
        "Peaks of simulated contact per rollout. They set no limit for hardware.",
        ROLLOUTS,
        _force,
    ),
)
