"""Inline SVG figures: same data, same bytes; colours that colour-blind readers tell apart.

Palette: Okabe and Ito 2008.
"""

import base64
import io
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from gates.evidence import Evidence, MissingEvidenceError
from gates.models import GateReport
from genpolicy.integrity.hashing import sha256_bytes_of

BLUE, ORANGE, GREEN = "#0072B2", "#E69F00", "#009E73"
RED, PURPLE, SKY, GREY, INK = "#D55E00", "#CC79A7", "#56B4E9", "#8A8F98", "#1F2430"
PALETTE = (BLUE, ORANGE, GREEN, PURPLE, SKY, RED, GREY, INK)
METHODS = {
    "bc": INK,
    "chunked_bc": GREY,
    "act": GREEN,
    "cvae": PURPLE,
    "diffusion": BLUE,
    "flow": ORANGE,
}
"""Colour of each method, the same in every figure of every gate; baselines first."""
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


PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
LARGEST_PHOTO_BYTES = 400_000
NUMBER = re.compile(r"-?\d+\.\d{3,}")


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


@dataclass(frozen=True)
class Plot:
    """A figure that can be drawn: `draw(evidence, report)` fills a new figure.

    Attributes:
        also: Further files that it is drawn from.
    """

    title: str
    caption: str
    source: str
    draw: Callable[[Evidence, GateReport], Figure]
    also: tuple[str, ...] = ()

    def picture(self, evidence: Evidence, report: GateReport) -> dict[str, Any]:
        """What this adds to a `Picture`."""
        return {"svg": svg(self.draw(evidence, report), self.title)}


@dataclass(frozen=True)
class Photo:
    """A PNG among the evidence; shown only if the report names these very bytes."""

    title: str
    caption: str
    source: str
    also: tuple[str, ...] = ()

    def picture(self, evidence: Evidence, report: GateReport) -> dict[str, Any]:
        """What this adds to a `Picture`.

        Raises:
            MissingEvidenceError: No such file, no PNG, too large, or other bytes than judged.
            IntegrityError: It cannot be read.
        """
        file = evidence.root / self.source
        if not file.is_file():
            raise MissingEvidenceError(f"{self.source} is missing")
        digest, data = sha256_bytes_of(file, keep=True)
        if report.materials.get(self.source) != digest:
            raise MissingEvidenceError(f"{self.source} is not the file that the report names")
        if not data.startswith(PNG_MAGIC) or len(data) > LARGEST_PHOTO_BYTES:
            raise MissingEvidenceError(
                f"{self.source} is no PNG of at most {LARGEST_PHOTO_BYTES} bytes"
            )
        return {"photo": f"data:image/png;base64,{base64.b64encode(data).decode()}"}


def draw_all(
    plots: Sequence[Plot | Photo], evidence: Evidence, report: GateReport
) -> list[Picture]:
    """Draw what the evidence allows; what is missing is said, never left out in silence."""
    pictures = []
    for index, plot in enumerate(plots):
        sources = (plot.source, *plot.also)
        try:
            with mpl.rc_context({**STYLE, "svg.hashsalt": f"{report.gate}{index}"}):
                found = plot.picture(evidence, report)
        except (MissingEvidenceError, KeyError, ValueError, TypeError, IndexError) as error:
            found = {"skipped": " ".join(str(error).split())[:200] or type(error).__name__}
        pictures.append(Picture(plot.title, plot.caption, sources, **found))
    return pictures


def new_figure(*, height: float = 2.8, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure of the page's width with `columns` axes side by side."""
    figure = Figure(figsize=(7.4, height), layout="constrained")
    axes = figure.subplots(1, columns, squeeze=False)
    return figure, list(axes[0])


def in_order(names: Iterable[str]) -> list[str]:
    """Names once each: known methods as in `METHODS`, then the others by name."""
    known = list(METHODS)
    return sorted(
        set(names), key=lambda name: (known.index(name) if name in known else len(known), name)
    )


def colours(names: Iterable[str]) -> dict[str, str]:
    """One colour per name: that of the method, where it is one."""
    order = in_order(names)
    free = [colour for colour in PALETTE if colour not in {METHODS.get(n) for n in order}]
    others = [name for name in order if name not in METHODS]
    return {name: METHODS[name] for name in order if name in METHODS} | {
        name: free[i % len(free)] for i, name in enumerate(others)
    }


def dashes(names: Iterable[str]) -> dict[str, Any]:
    """One line style per name, so that curves which coincide can still be told apart."""
    return {name: DASHES[i % len(DASHES)] for i, name in enumerate(in_order(names))}


def plain_ticks(axis: Axis) -> None:
    """Ticks of a logarithmic axis as plain numbers (0.1, 2, 50), not as powers."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


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
    body = re.sub(r' d="[^"]*"', lambda path: NUMBER.sub(_rounded, path.group(0)), body)
    start = Markup('<svg role="img" aria-label="{}" {}>').format(
        label, Markup(box.group(0) if box else "")
    )
    return start + Markup(body.strip())


def _rounded(number: re.Match[str]) -> str:
    """Two decimals: a hundredth of a point is finer than any screen, and a third of the bytes."""
    return f"{float(number.group(0)):.2f}"
