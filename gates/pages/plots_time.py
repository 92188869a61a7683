"""Figures of Gate B: latency per component, mode coverage against NFE."""

import itertools
import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.pages.figures import Plot, Table, colours, dashes, in_order, markers
from gates.report import GateReport
from gates.reproducibility.latency_budget import (
    LATENCY,
    MILLI,
    TERMS,
    Spans,
    budget_of,
    spans_of_processes,
)
from gates.reproducibility.settings import COVERAGE, RELOAD
from gates.words import three
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.evidence.rows.reproducibility import CandidatesRow, CoverageRow, LatencyRow
from genpolicy.pages.figures.drawing import (
    GREY,
    in_milli,
    in_percent,
    new_figure,
    plain_ticks,
)

TEMPERATURES = ("warm", "cold")
CANDIDATES_DRAWN = "artifacts/latency/candidates.parquet"
QUIET = "none"


def _latency(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(LATENCY, LatencyRow)
    warm = frame[frame["temperature"] == "warm"]
    if len(warm) == 0:
        raise MissingEvidenceError("no warm measurement")
    methods = in_order(warm["method"])
    colour, shape = colours(methods), markers(methods)
    figure, (axes,) = new_figure(height=1.0 + 0.3 * len(TERMS))
    step = 0.7 / max(len(methods), 1)
    for rank, method in enumerate(methods):
        part = warm[warm["method"] == method]
        for place, term in enumerate(TERMS):
            rows = part[part["component"] == term]
            if len(rows) == 0:
                continue
            times = numbers(rows, "seconds") * MILLI
            height = place - 0.35 + step * (rank + 0.5)
            p50, p95 = np.quantile(times, [0.5, 0.95], method="higher")
            axes.hlines(height, p50, times.max(), color=colour[method], lw=1.0)
            axes.plot([p50], [height], shape[method], color=colour[method], ms=4)
            axes.plot([p95], [height], "|", color=colour[method], ms=8, mew=1.8)
            axes.plot([times.max()], [height], ">", color=colour[method], ms=3)
        axes.plot([], [], shape[method], color=colour[method], label=method)
    declared = set(warm.loc[warm["source"] == "declared", "component"])
    axes.set_yticks(
        np.arange(len(TERMS)), [f"{t} (declared)" if t in declared else t for t in TERMS]
    )
    axes.invert_yaxis()
    axes.set_xscale("log")
    plain_ticks(axes.xaxis)
    axes.set_xlabel("warm latency, ms (point p50, bar p95, arrow maximum)")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _budgets(evidence: Evidence, report: GateReport) -> Table:
    """End to end for every method; term by term for those that stand for promotion."""
    confidence = float(report.settings["confidence"])
    frame = evidence.rows(LATENCY, LatencyRow)
    heads = ["method", "term", "owner", "known from"]
    heads += [f"{t} {what}, ms" for t in TEMPERATURES for what in ("p50", "p95", "longest")]
    table = [tuple(heads)]
    for method in in_order(frame["method"]):
        own = frame[frame["method"] == method]
        budgets = [budget_of(own, name, confidence=confidence) for name in TEMPERATURES]
        ends = [_cells(budget.end_to_end) for budget in budgets]
        table.append((method, "end to end", "", "", *itertools.chain(*ends)))
        sums = [("", three(budget.sum_of_p95_s * MILLI), "") for budget in budgets]
        table.append((method, "p95 of the terms, summed", "", "", *itertools.chain(*sums)))
        for term in TERMS if method in report.candidates else ():
            cells = [_cells(budget.terms[term]) for budget in budgets]
            first = budgets[0]
            row = (method, term, first.owners[term], first.sources[term])
            table.append((*row, *itertools.chain(*cells)))
    return tuple(table)


def _cells(spans: Spans) -> tuple[str, str, str]:
    return _interval(spans.p50), _interval(spans.p95), three(spans.longest * MILLI)


def _interval(found: tuple[float, float, float]) -> str:
    """Milliseconds; an end that so few cannot bound is said to be open."""
    point, lower, upper = (value * MILLI for value in found)
    ends = [three(end) if math.isfinite(end) else "open" for end in (lower, upper)]
    return f"{three(point)} ({ends[0]} to {ends[1]})"


def _coverage(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(COVERAGE, CoverageRow)
    figure, (left, right) = new_figure(columns=2)
    colour = colours(list(frame["method"]))
    dash = dashes(frame["method"])
    for method in in_order(frame["method"]):
        own = frame[frame["method"] == method].sort_values("nfe").groupby(["sampler", "settings"])
        for marker, (said, rows) in zip(itertools.cycle("os^vDPX"), own, strict=False):
            look = {"color": colour[method], "ls": dash[method], "marker": marker, "ms": 4}
            nfe = numbers(rows, "nfe")
            left.plot(nfe, numbers(rows, "modes_covered_share"), **look)
            name = ", ".join(str(part) for part in (method, *said) if part)
            right.plot(nfe, numbers(rows, "spread_m"), label=name, **look)
    for axes in (left, right):
        axes.set_xscale("log", base=2)
        ticks = sorted(set(numbers(frame, "nfe").tolist()))
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xlabel("network evaluations per sample (NFE)")
    left.set_ylim(0, 1.05)
    right.set_ylim(bottom=0)
    in_percent(left.yaxis)
    in_milli(right.yaxis)
    left.set_ylabel("every mode reached, share")
    right.set_ylabel("spread of samples, mm")
    figure.legend(loc="outside lower center", ncols=4)
    return figure


def _by_candidates(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(CANDIDATES_DRAWN, CandidatesRow)
    methods = in_order(frame["method"])
    colour, shape = colours(methods), markers(methods)
    counts = sorted(set(frame["candidates"].tolist()))
    figure, (axes,) = new_figure(height=2.8)
    for place, method in enumerate(methods):
        for load, own in frame[frame["method"] == method].groupby("load"):
            quiet = load == QUIET
            for rank, count in enumerate(counts):
                times = numbers(own[own["candidates"] == count], "seconds") * MILLI
                p50, p95 = np.quantile(times, [0.5, 0.95], method="higher")
                at = rank + (place - (len(methods) - 1) / 2) * 0.2 + (0.0 if quiet else 0.08)
                axes.vlines(at, p50, p95, color=colour[method], lw=1.2)
                face = colour[method] if quiet else "white"
                look: dict[str, Any] = {"color": colour[method], "marker": shape[method], "ms": 4}
                axes.plot([at], [p50], markerfacecolor=face, **look)
        axes.plot([], [], shape[method], color=colour[method], label=method)
    deadline = _deadline_s(evidence)
    if deadline is not None:
        axes.axhline(deadline * MILLI, color=GREY, lw=0.8)
        axes.text(0.01, deadline * MILLI, "deadline of the whole answer", fontsize=8, va="bottom",
                  transform=axes.get_yaxis_transform())  # fmt: skip
    axes.set_xticks(np.arange(len(counts)), [f"{count:g}" for count in counts])
    axes.set_yscale("log")
    plain_ticks(axes.yaxis)
    axes.set_xlabel("candidates of an invocation")
    axes.set_ylabel("observation to proposal, ms")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _deadline_s(evidence: Evidence) -> float | None:
    """Of the identity cards; they have the same."""
    try:
        cards = evidence.document(RELOAD, CANDIDATES)
    except MissingEvidenceError:
        return None
    return next((entry.card.deadline_s for entry in cards.values()), None)


def _processes(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(LATENCY, LatencyRow)
    methods = in_order(frame["method"])
    colour, shape = colours(methods), markers(methods)
    figure, places = new_figure(height=1.0 + 0.3 * len(methods), columns=len(TEMPERATURES))
    for axes, temperature in zip(places, TEMPERATURES, strict=True):
        for place, method in enumerate(methods):
            own = frame[frame["method"] == method]
            for run, medians in spans_of_processes(own, temperature).items():
                face = colour[method] if run == 1 else "white"
                heights = np.full(len(medians), place + 0.16 * (-1 if run == 1 else 1))
                look: dict[str, Any] = {
                    "color": colour[method],
                    "marker": shape[method],
                    "ms": 5,
                    "ls": "",
                }
                axes.plot(medians * MILLI, heights, markerfacecolor=face, **look)
        axes.set_yticks(np.arange(len(methods)), methods)
        axes.set_ylim(len(methods) - 0.5, -0.5)
        axes.set_xscale("log")
        plain_ticks(axes.xaxis)
        axes.set_xlabel(f"{temperature}, each process, ms")
    return figure


PLOTS = (
    Plot(
        "Where the time goes",
        "The eleven terms from exposure to queue, logarithmic. Declared terms are drawn from "
        "settings, the others were measured here, one thread. Adding up the p95 of the terms is "
        "the budget on paper; invocations may take less, where slow terms do not coincide, or "
        "more. Both stand below it on the page of gate B, with intervals for "
        "these processes and no others.",
        LATENCY,
        _latency,
        read=_budgets,
    ),
    Plot(
        "Modes and spread against NFE",
        "Left: share of held-out situations of which every mode is reached by one sample. Right: "
        "how far samples of one situation lie apart. One mark per sampler and its settings, joined "
        "over its steps or tolerance. The gate asks more, at "
        "the chosen NFE: every mode needs its share of admissible samples, and few may lie "
        "between.",
        COVERAGE,
        _coverage,
    ),
    Plot(
        "What do more candidates cost, and what a busy machine?",
        "Dot: median of warm invocations; line: up to their p95. Full: alone on the machine; "
        "hollow: beside a process on every core. Not among them: sensors, network, and the check "
        "of each candidate that is tried.",
        CANDIDATES_DRAWN,
        _by_candidates,
        also=(f"{RELOAD}/{CANDIDATES.file}",),
    ),
    Plot(
        "Measured twice, the same latency?",
        "A mark is one fresh process, measured terms summed: warm the median of its invocations, "
        "cold its first call. Full: first measurement; hollow: second. The gate asks whether the "
        "two sets differ by less than "
        "its limit, at the worse end of an interval over processes.",
        LATENCY,
        _processes,
    ),
)
