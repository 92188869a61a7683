"""Figure of Gate B about likelihood: density of each mode against its share of the samples."""

import math

from matplotlib.figure import Figure

from gates.evidence import Evidence
from gates.pages.figures import Plot, Table, colours, in_order, markers
from gates.report import GateReport
from gates.reproducibility.densities import Agreement, agreement, densities
from gates.reproducibility.settings import DENSITY
from gates.words import share_between
from genpolicy.pages.figures.drawing import GREY, in_percent, new_figure


def _densities(evidence: Evidence, report: GateReport) -> Figure:
    frame = densities(evidence)
    methods = in_order(frame["method"])
    colour, shape = colours(methods), markers(methods)
    figure, places = new_figure(height=2.8, columns=len(methods))
    for axes, method in zip(places, methods, strict=True):
        own = frame[frame["method"] == method]
        axes.plot(own["share"], own["gain"], shape[method], ms=4, color=colour[method])
        axes.axhline(0.0, color=GREY, lw=0.8)
        axes.set_xlim(-0.03, 1.03)
        in_percent(axes.xaxis)
        axes.set_xlabel(f"{method}: share of samples in the mode")
    places[0].set_ylabel("log-density over the mean, nats")
    return figure


def _table(evidence: Evidence, report: GateReport) -> Table:
    frame, confidence = densities(evidence), float(report.settings["confidence"])
    heads = (
        "method", "denser mode drawn more often, share", "situations that can say", "episodes",
        "situations with a tie of samples",
        "situations with a density that is infinite or no number",
    )  # fmt: skip
    found = [agreement(frame, name, confidence=confidence) for name in in_order(frame["method"])]
    return (
        heads,
        *(
            (
                item.method,
                _text(item),
                f"{item.situations}",
                f"{item.episodes}",
                f"{item.tied}",
                f"{item.unknown}",
            )
            for item in found
        ),
    )


def _text(item: Agreement) -> str:
    if math.isnan(item.share):
        return "not known"
    return share_between(item.share, *item.interval)


PLOTS = (
    Plot(
        "Does the density know the modes that are drawn?",
        "A mark is one mode of a held-out situation: how many of the samples reach it, and how "
        "much denser its demonstrated chunk is than the mean of the situation's modes. Not "
        "judged. Only heads that state a density have one, of the exact equation, where "
        "the samples are those of the few steps that are deployed; the diffusion's is blurred by "
        "its least noise, so that the two are not compared by height. A density is no share: a "
        "narrow mode is dense and may be rare. A situation in which the density of a mode is "
        "infinite or no number has no mean: none of its modes is drawn, and the table counts it. "
        "With two modes, a density that knows nothing agrees in half of the situations.",
        DENSITY,
        _densities,
        read=_table,
    ),
)
