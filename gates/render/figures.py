"""Inline SVG figures: same data, same bytes; colours that colour-blind readers tell apart.

Palette: Okabe and Ito 2008.
"""

import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError
from gates.models import GateReport

BLUE, ORANGE, GREEN = "#0072B2", "#E69F00", "#009E73"
RED, PURPLE, SKY, GREY, INK = "#D55E00", "#CC79A7", "#56B4E9", "#8A8F98", "#1F2430"
PALETTE = (BLUE, ORANGE, GREEN, PURPLE, SKY, RED, GREY, INK)
HATCHES = ("", "//", "..", "xx", "\\\\", "++", "--", "oo")
STYLE: Any = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.sans-serif": ["Helvetica", "Arial", "DejaVu Sans"],
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "axes.grid": True,
    "grid.color": "#E6E8EC",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "lines.linewidth": 1.6,
}


@dataclass(frozen=True)
class Picture:
    """A figure of a report, or the reason why it is not there.

    Attributes:
        title: What it shows.
        caption: How to read it.
        source: Table that it is drawn from, relative to the repository.
        svg: The drawing; None if skipped.
        skipped: Why there is none.
    """

    title: str
    caption: str
    source: str
    svg: Markup | None = None
    skipped: str = ""


@dataclass(frozen=True)
class Plot:
    """A figure that can be drawn: `draw(evidence, report)` fills a new figure."""

    title: str
    caption: str
    source: str
    draw: Callable[[Evidence, GateReport], Figure]


def draw_all(plots: Sequence[Plot], evidence: Evidence, report: GateReport) -> list[Picture]:
    """Draw what the evidence allows; what is missing is said, never left out in silence."""
    pictures = []
    for index, plot in enumerate(plots):
        try:
            with mpl.rc_context({**STYLE, "svg.hashsalt": f"{report.gate}{index}"}):
                drawing = svg(plot.draw(evidence, report), plot.title)
            pictures.append(Picture(plot.title, plot.caption, plot.source, drawing))
        except (MissingEvidenceError, KeyError, ValueError, TypeError, IndexError) as error:
            why = " ".join(str(error).split())[:200] or type(error).__name__
            pictures.append(Picture(plot.title, plot.caption, plot.source, skipped=why))
    return pictures


def new_figure(*, height: float = 2.8, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure of the page's width with `columns` axes side by side."""
    figure = Figure(figsize=(7.4, height), layout="constrained")
    axes = figure.subplots(1, columns, squeeze=False)
    return figure, list(axes[0])


def colours(names: Sequence[str]) -> dict[str, str]:
    """One colour per name, in sorted order."""
    return {name: PALETTE[i % len(PALETTE)] for i, name in enumerate(sorted(set(names)))}


def svg(figure: Figure, label: str) -> Markup:
    """The figure as an SVG element for HTML: no remote name, no style of its own."""
    sink = io.StringIO()
    FigureCanvasSVG(figure)
    nothing = {"Creator": None, "Date": None, "Format": None, "Type": None}
    figure.savefig(sink, format="svg", metadata=nothing)
    text = sink.getvalue()
    text = text[text.index("<svg") :]
    head, body = text.split(">", 1)
    box = re.search(r'viewBox="[^"]*"', head)
    body = re.sub(r"<style[^>]*>.*?</style>", "", body, flags=re.DOTALL)
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = body.replace("xlink:href", "href")
    start = Markup('<svg role="img" aria-label="{}" {}>').format(
        label, Markup(box.group(0) if box else "")
    )
    return start + Markup(body.strip())
