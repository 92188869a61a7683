"""Figure of Gate B: samplers of the sweep against each other, with the deadline drawn in."""

import math
from typing import Any

from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.figures import Listing, Plot, Table, colours, dashes, in_order, markers
from gates.report import GateReport
from gates.reproducibility.front import (
    SWEEP,
    Choice,
    Setting,
    advice,
    choice,
    deadline_of,
    efficient,
    settings_of,
)
from gates.reproducibility.latency_budget import LATENCY, MILLI
from gates.reproducibility.settings import COVERAGE, RELOAD
from gates.words import percent, three
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.evidence.rows.reproducibility import CoverageRow
from genpolicy.pages.figures.drawing import GREY, in_percent, new_figure, plain_ticks

Sweeps = dict[str, tuple[list[Setting], Choice, float]]


def _sweeps(evidence: Evidence, report: GateReport) -> Sweeps:
    """Of each method its settings, what the rule says, and the deadline, s.

    A method of which a term is unknown stands on no axis; that is no reason to show nobody.

    Raises:
        MissingEvidenceError: Of no method everything is known.
    """
    confidence, found = float(report.settings["confidence"]), {}
    unknown = []
    for method in in_order(evidence.rows(COVERAGE, CoverageRow)["method"]):
        try:
            settings = settings_of(evidence, method, confidence=confidence)
        except MissingEvidenceError as error:
            unknown.append(error)
            continue
        deadline_s = deadline_of(evidence, method)
        found[method] = settings, choice(settings, deadline_s=deadline_s), deadline_s
    if unknown and not found:
        raise unknown[0]
    return found


def _front(evidence: Evidence, report: GateReport) -> Figure:
    sweeps = _sweeps(evidence, report)
    colour, shape, dash = colours(sweeps), markers(sweeps), dashes(sweeps)
    figure, places = new_figure(columns=3)
    for method, (every, _, _) in sweeps.items():
        settings = [setting for setting in every if math.isfinite(setting.answer_s)]
        kept = efficient(settings)
        for axes, heights in zip(places, _heights(settings), strict=True):
            times = [setting.answer_s * MILLI for setting in settings]
            line = [at for at, on in zip(zip(times, heights, strict=True), kept, strict=True) if on]
            if line:
                way = {"color": colour[method], "ls": dash[method], "lw": 0.9}
                axes.plot(*zip(*sorted(line), strict=True), **way)
            for at, height, on in zip(times, heights, kept, strict=True):
                face = colour[method] if on else "white"
                look: dict[str, Any] = {"color": colour[method], "marker": shape[method], "ms": 4}
                axes.plot([at], [height], markerfacecolor=face, **look)
        look = {"color": colour[method], "marker": shape[method], "ls": dash[method], "lw": 0.9}
        places[0].plot([], [], label=method, **look)
    names = ("every mode reached, share", "chunk error, normalised", "jerk p95, m/s³")
    for axes, name in zip(places, names, strict=True):
        for deadline_s in sorted({found[2] for found in sweeps.values()}):
            axes.axvline(deadline_s * MILLI, color=GREY, lw=0.8)
        axes.set_xscale("log")
        plain_ticks(axes.xaxis)
        axes.set_ylabel(name)
        axes.set_ylim(bottom=0)
    in_percent(places[0].yaxis)
    places[1].set_xlabel("whole answer, p95 of all terms summed, ms; line: deadline")
    figure.legend(loc="outside lower center", ncols=4)
    return figure


def _heights(settings: list[Setting]) -> tuple[list[float], list[float], list[float]]:
    return (
        [setting.coverage for setting in settings],
        [setting.chunk_error for setting in settings],
        [setting.jerk_p95_m_s3 for setting in settings],
    )


def _table(evidence: Evidence, report: GateReport) -> Table:
    heads = (
        "method", "setting", "NFE", "tolerance", "observation to proposal p50, ms",
        "answer p95, ms", "coverage (lower end)", "chunk error", "jerk p95, m/s³", "efficient",
    )  # fmt: skip
    rows = []
    for method, (settings, _, _) in _sweeps(evidence, report).items():
        for setting, on in zip(settings, efficient(settings), strict=True):
            tolerance = "" if setting.tolerance is None else f"{setting.tolerance:g}"
            rows.append(
                (
                    method,
                    setting.name,
                    f"{setting.nfe}",
                    tolerance,
                    _milliseconds(setting.p50_s),
                    _milliseconds(setting.answer_s),
                    f"{percent(setting.coverage)} ({percent(setting.coverage_lower)})",
                    f"{setting.chunk_error:.3g}",
                    three(setting.jerk_p95_m_s3),
                    _said(setting, on=on),
                )
            )
    return (heads, *rows)


def _milliseconds(time_s: float) -> str:
    return f"{time_s * MILLI:.3g}" if math.isfinite(time_s) else "no answer"


def _said(setting: Setting, *, on: bool) -> str:
    if setting.given_up:
        return f"no: {setting.given_up} chunks were given up at its cap"
    if setting.nonfinite:
        return f"no: {setting.nonfinite} chunks are no numbers"
    return "yes" if on else "no"


def _advice(evidence: Evidence, report: GateReport) -> Table:
    heads = ("method", "which setting would you deploy?", "what does the next cheaper one lose?")
    sweeps = _sweeps(evidence, report)
    rows = [
        (method, *advice(found, deadline_s=deadline_s))
        for method, (_, found, deadline_s) in sweeps.items()
    ]
    return (heads, *rows)


READ = (LATENCY, SWEEP, f"{RELOAD}/{CANDIDATES.file}")

PLOTS: tuple[Plot | Listing, ...] = (
    Plot(
        "What does each setting of the sampler buy?",
        "A mark is one sampler with its steps or tolerance. Full and joined: efficient, that is, "
        "no other setting of the method is as good in time, coverage, chunk error and jerk, and "
        "better in one. Across: the p95 of the invocation and of every other term, added up "
        "as on paper. Error and jerk are of one chunk for each of some held-out windows, as drawn, "
        "before projection; with several good plans no error goes to zero. Not judged.",
        COVERAGE,
        _front,
        also=READ,
        read=_table,
    ),
    Listing(
        "Which setting would you deploy?",
        "By a rule, from the figure above: of the settings whose answer keeps the deadline, the "
        "cheapest whose coverage is not below the interval of the best. Differences are those of "
        "the next cheaper setting. What is deployed stands in `train_generators.samplers`.",
        COVERAGE,
        _advice,
        also=READ,
    ),
)
