"""Figures of Gate B: latency per component, mode coverage against NFE."""

import itertools

import numpy as np
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.pages.figures import Plot, colours, dashes, in_order
from gates.report import GateReport
from gates.reproducibility.settings import COVERAGE
from gates.reproducibility.timing import LATENCY, TERMS
from genpolicy.evidence.rows.reproducibility import CoverageRow, LatencyRow
from genpolicy.pages.figures.drawing import GREY, new_figure, plain_ticks

MILLI = 1e3


def _latency(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(LATENCY, LatencyRow)
    warm = frame[frame["temperature"] == "warm"]
    if len(warm) == 0:
        raise MissingEvidenceError("no warm measurement")
    methods = in_order(warm["method"])
    colour = colours(methods)
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
            axes.plot([p50], [height], "o", color=colour[method], ms=4)
            axes.plot([p95], [height], "|", color=colour[method], ms=8, mew=1.8)
            axes.plot([times.max()], [height], ">", color=colour[method], ms=3)
        axes.plot([], [], "o", color=colour[method], label=method)
    declared = set(warm.loc[warm["source"] == "declared", "component"])
    axes.set_yticks(
        np.arange(len(TERMS)), [f"{t} (declared)" if t in declared else t for t in TERMS]
    )
    axes.invert_yaxis()
    axes.set_xscale("log")
    plain_ticks(axes.xaxis)
    axes.set_xlabel("warm latency, ms (dot p50, bar p95, arrow maximum)")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _coverage(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(COVERAGE, CoverageRow)
    figure, (left, right) = new_figure(columns=2)
    colour = colours(list(frame["method"]))
    dash = dashes(frame["method"])
    for method in in_order(frame["method"]):
        own = frame[frame["method"] == method].sort_values("nfe").groupby("sampler")
        for marker, (sampler, rows) in zip(itertools.cycle("os^vDPX"), own, strict=False):
            look = {"color": colour[method], "ls": dash[method], "marker": marker, "ms": 4}
            nfe = numbers(rows, "nfe")
            left.plot(nfe, numbers(rows, "modes_covered_share"), **look)
            right.plot(nfe, numbers(rows, "spread_m"), label=f"{method}, {sampler}", **look)
    for axes in (left, right):
        axes.set_xscale("log", base=2)
        ticks = sorted(set(numbers(frame, "nfe").tolist()))
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xlabel("network evaluations per sample (NFE)")
    left.set_ylim(0, 1.05)
    right.set_ylim(bottom=0)
    left.set_ylabel("every mode reached, share")
    right.set_ylabel("spread of samples, m")
    figure.legend(loc="outside lower center", ncols=4)
    return figure


def _cold(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(LATENCY, LatencyRow)
    part = frame[frame["component"] == "sample"]
    methods = in_order(part["method"])
    colour = colours(methods)
    figure, (axes,) = new_figure(height=2.6)
    for method in methods:
        for run, style in ((1, "-"), (2, "--")):
            rows = part[(part["method"] == method) & (part["run"] == run)]
            rows = rows[rows["temperature"] == "warm"]
            if len(rows) == 0:
                continue
            times = np.sort(numbers(rows, "seconds") * MILLI)
            kept = times[np.linspace(0, len(times) - 1, min(len(times), 200)).astype(int)]
            share = np.linspace(1 / len(kept), 1, len(kept))
            axes.plot(kept, share, ls=style, color=colour[method], label=f"{method}, run {run}")
    axes.axhline(0.95, color=GREY, lw=0.8)
    axes.set_xscale("log")
    plain_ticks(axes.xaxis)
    axes.set_ylim(0, 1.02)
    axes.text(
        0.99, 0.94, "p95", transform=axes.get_yaxis_transform(), fontsize=8, ha="right", va="top"
    )
    axes.set_xlabel("time to sample, ms")
    axes.set_ylabel("share of invocations")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


PLOTS = (
    Plot(
        "Where the time goes",
        "The eleven terms from exposure to queue, logarithmic. Declared terms are drawn from "
        "settings, the others were measured here, one thread. The p95 values do not add up to "
        "the end-to-end p95: slow terms seldom coincide.",
        LATENCY,
        _latency,
    ),
    Plot(
        "Modes and spread against NFE",
        "Left: share of held-out situations of which every mode is reached by one sample. Right: "
        "how far samples of one situation lie apart. One mark per sampler. The gate asks more, at "
        "the chosen NFE: every mode needs its share of admissible samples, and few may lie "
        "between.",
        COVERAGE,
        _coverage,
    ),
    Plot(
        "Two fresh processes, same latency?",
        "Share of invocations whose warm sampling time is at most this long, in the first (solid) "
        "and second (dashed) process. The gate compares their medians.",
        LATENCY,
        _cold,
    ),
)
