"""Success of Gate D against how hard a condition is: a drawing, and the numbers behind it."""

import math

from matplotlib.figure import Figure

from gates.evidence import Evidence
from gates.pages.bound import require_bound
from gates.pages.figures import Listing, Plot, Table, in_order, line_looks
from gates.report import GateReport
from gates.stress.curves import Curve, curves
from gates.stress.rollouts import CURVES, ROLLOUTS
from gates.words import percent
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.pages.figures.drawing import GREY, in_percent, new_figure


def _curves(evidence: Evidence, report: GateReport) -> list[Curve]:
    require_bound(evidence, report, CURVES)
    methods = in_order(evidence.rows(ROLLOUTS, RolloutRow)["method"])
    return curves(
        evidence,
        methods,
        confidence=float(report.settings["confidence"]),
        root_seed=int(report.settings["root_seed"]),
    )


def _said(value: float) -> str:
    if math.isnan(value):
        return "nothing succeeds undisturbed"
    return "beyond what was run" if math.isinf(value) else f"{value:.3g}"


def _listed(evidence: Evidence, report: GateReport) -> Table:
    lines = []
    for curve in _curves(evidence, report):
        shares = "; ".join(
            f"{point.severity:g}{' (judged)' if point.judged else ''}: {percent(point.share)} "
            f"({percent(point.lower)} to {percent(point.upper)})"
            for point in curve.points
        )
        middle, low, high = map(_said, curve.half)
        half = middle if low == middle == high else f"{middle} ({low} to {high})"
        starts = str(min(point.starts for point in curve.points))
        lines.append((f"{curve.condition}, {curve.field}", curve.method, shares, half, starts))
    return (("condition", "method", "success by size", "half of nominal at", "starts"), *lines)


def _draw(evidence: Evidence, report: GateReport) -> Figure:
    found = _curves(evidence, report)
    names = sorted({curve.condition for curve in found})
    methods = in_order([curve.method for curve in found])
    looks = line_looks(methods)
    figure, axes = new_figure(columns=len(names), height=2.8)
    for place, name in zip(axes, names, strict=True):
        for curve in (one for one in found if one.condition == name):
            sizes = [point.severity for point in curve.points]
            own = looks[curve.method]
            place.plot(sizes, [point.share for point in curve.points], label=curve.method, **own)
            place.vlines(
                sizes, [point.lower for point in curve.points],
                [point.upper for point in curve.points], color=own["color"], lw=0.8,
            )  # fmt: skip
            for point in curve.points:
                if point.judged:
                    place.axvline(point.severity, color=GREY, lw=0.8)
            place.set_xlabel(f"{name}: {curve.field}")
        place.set_ylim(0, 1.02)
    for place in axes:
        in_percent(place.yaxis)
    axes[0].set_ylabel("share of successful rollouts")
    axes[-1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


CAPTION = (
    "Every method on the same starts at every size; nominal stands where nothing is injected. What "
    "criteria and the promotion test are held against is the judged size alone (grey). Where "
    "success is half of nominal is interpolated between two sizes; its interval draws whole starts "
    "again, and may lie beyond what was run. "
)
CURVE = Plot("Success against severity", CAPTION, CURVES, _draw, also=(ROLLOUTS,), optional=True)
HALF = Listing(
    "Where success falls to half",
    CAPTION,
    CURVES,
    _listed,
    also=(ROLLOUTS,),
    optional=True,
)
