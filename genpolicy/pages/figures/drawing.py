"""Inline SVG figures: same data, same bytes; colours that colour-blind readers tell apart.

Palette: Okabe and Ito 2008.
"""

import io
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

BLUE, ORANGE, GREEN = "#0072B2", "#E69F00", "#009E73"
RED, PURPLE, SKY, GREY, INK = "#D55E00", "#CC79A7", "#56B4E9", "#8A8F98", "#1F2430"
TEAL = "#2A9D9D"
PALETTE = (BLUE, ORANGE, GREEN, PURPLE, SKY, RED, GREY, INK)
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (2, 1.2)), (0, (6, 1.5, 1, 1.5)))
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

POINTS_PER_INCH = 72.0
"""One unit of a drawing is a point."""
LEAST_TEXT_PX = 9.0
"""No text of a plot is shown smaller than this: on a narrow screen the plot scrolls instead."""
TEXT_SIZE = re.compile(r"font(?:-size)?: [^;\"]*?([\d.]+)px")
NUMBER = re.compile(r"-?\d+\.\d{3,}")
NAME = re.compile(r' id="([^"]+)"')
REFERENCE = re.compile(r'(?:href="#|url\(#)([^")]+)')


@dataclass(frozen=True)
class Picture:
    """A figure of a report, or the reason why it is not there.

    Attributes:
        title: What it shows.
        caption: How to read it.
        sources: Files that it is drawn from, relative to the repository.
        svg: The drawing; None if skipped or a photo.
        photo: A photo as a data URI; empty if skipped or a drawing.
        skipped: Why there is none.
    """

    title: str
    caption: str
    sources: tuple[str, ...]
    svg: Markup | None = None
    photo: str = ""
    skipped: str = ""


def new_figure(*, height: float = 2.8, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure of the page's width with `columns` axes side by side."""
    figure = Figure(figsize=(7.4, height), layout="constrained")
    axes = figure.subplots(1, columns, squeeze=False)
    return figure, list(axes[0])


def plain_ticks(axis: Axis) -> None:
    """Ticks of a logarithmic axis as plain numbers (0.1, 2, 50), not as powers."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def in_percent(axis: Axis) -> None:
    """Shares on an axis as percent; what is drawn stays a share."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{round(100 * value, 9):g} %"))


def in_points(axis: Axis) -> None:
    """Differences of shares on an axis as points, the unit its label says."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{round(100 * value, 9):g}"))


def in_milli(axis: Axis) -> None:
    """Metres or seconds on an axis in mm or ms; what is drawn stays in SI units."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{round(1000 * value, 9):g}"))


def drawn(draw: Callable[[], Figure], label: str, *, salt: str) -> Markup:
    """Call `draw` in the project's style and give its figure as an SVG element.

    Args:
        draw: Makes the figure.
        label: What it shows, for readers who do not see it.
        salt: Distinguishes the figures of one page, so that their inner names never meet.
    """
    with mpl.rc_context({**STYLE, "svg.hashsalt": salt}):
        return svg(draw(), label)


def svg(figure: Figure, label: str) -> Markup:
    """The figure as an SVG element for HTML: no remote name, no style of its own.

    It stands in an element that scrolls sideways where the page is narrower than `--least`, the
    width at which its smallest text has `LEAST_TEXT_PX`.
    """
    sink = io.StringIO()
    nothing = {"Creator": None, "Date": None, "Format": None, "Type": None}
    # As `savefig`, which draws all of it twice: once without a line, for the layout alone.
    FigureCanvasSVG(figure).print_svg(sink, metadata=nothing)  # type: ignore[no-untyped-call]
    text = sink.getvalue()
    text = text[text.index("<svg") :]
    head, body = text.split(">", 1)
    box = re.search(r'viewBox="[^"]*"', head)
    body = re.sub(r"<style[^>]*>.*?</style>", "", body, flags=re.DOTALL)
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = body.replace("xlink:href", "href")
    # Groups are named alike in every figure; only what a figure refers to keeps its name.
    used = set(REFERENCE.findall(body))
    body = NAME.sub(lambda name: name.group(0) if name.group(1) in used else "", body)
    body = re.sub(r' d="[^"]*"', lambda path: NUMBER.sub(_rounded, path.group(0)), body)
    smallest = min(map(float, TEXT_SIZE.findall(body)), default=LEAST_TEXT_PX)
    least = math.ceil(POINTS_PER_INCH * figure.get_figwidth() * LEAST_TEXT_PX / smallest)
    start = Markup(
        '<div class="plot" style="--least:{}px" tabindex="0" role="group" aria-label="scrolls '
        'sideways on a narrow screen"><svg role="img" aria-label="{}" {}>'
    ).format(least, label, Markup(box.group(0) if box else ""))
    return start + Markup(body.strip()) + Markup("</div>")


def _rounded(number: re.Match[str]) -> str:
    """Two decimals: a hundredth of a point is finer than any screen, and a third of the bytes."""
    return f"{float(number.group(0)):.2f}"
