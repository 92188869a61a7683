"""Figures of the gates' pages: what is drawn from evidence, what is shown as it lies there."""

import base64
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError
from gates.report import GateReport
from genpolicy.integrity.hashing import sha256_bytes_of
from genpolicy.pages.figures.drawing import (
    DASHES,
    Picture,
    drawn,
)

METHODS = {
    "bc": "#3C3C69",
    "chunked_bc": "#780000",
    "chunked_l1": "#874B3C",
    "one_mode_bc": "#4B1E2D",
    "bc_noise": "#965AFF",
    "act": "#00A578",
    "cvae": "#B478A5",
    "ibc": "#9696F0",
    "diffusion": "#006969",
    "flow": "#E1872D",
    "flow_policy": "#C34B00",
    "manicm": "#783CB4",
}
"""Colour of each method, the same in every figure of every gate; baselines first.

Found by search: none is grey, and any two are at least 15 apart (CAM02-UCS), also for readers
without red, green or blue cones, as a test holds.
"""
MARKERS = "osD^vPXpdh<8"
"""One shape of a point per method, so that nothing is told by colour alone."""
PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
LARGEST_PHOTO_BYTES = 400_000


Table = tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Small:
    """One drawing of a series as the page shows it: its title, what is said of it, the drawing."""

    title: str
    lines: tuple[str, ...]
    svg: Markup


@dataclass(frozen=True)
class Shown(Picture):
    """A figure of a gate's page.

    Attributes:
        in_words: The same in words: heads, then rows of cells; empty without.
        listed: A table that stands in the place of a drawing; empty for a drawing.
        folded: Further tables, each with what it is called; folded until somebody asks.
        series: Small drawings, each with its text.
    """

    in_words: Table = ()
    listed: Table = ()
    folded: tuple[tuple[str, Table], ...] = ()
    series: tuple[Small, ...] = ()


@dataclass(frozen=True)
class Plot:
    """A figure that can be drawn: `draw(evidence, report)` fills a new figure.

    Attributes:
        also: Further files that it is drawn from.
        read: The same in words, for readers who do not see it: heads, then rows of cells.
        optional: Left out where the report names no such source: then there was none to write.
    """

    title: str
    caption: str
    source: str
    draw: Callable[[Evidence, GateReport], Figure]
    also: tuple[str, ...] = ()
    read: Callable[[Evidence, GateReport], Table] | None = None
    optional: bool = False

    def picture(self, evidence: Evidence, report: GateReport, salt: str) -> dict[str, Any]:
        """What this adds to a `Shown`."""
        svg = drawn(lambda: self.draw(evidence, report), self.title, salt=salt)
        return {"svg": svg, "in_words": self.read(evidence, report) if self.read else ()}


@dataclass(frozen=True)
class Folded:
    """A table that is shown to those who ask.

    Attributes:
        summary: What it is called.
        read: Gives it: heads, then rows of cells.
    """

    summary: str
    read: Callable[[Evidence, GateReport], Table]


@dataclass(frozen=True)
class Listing:
    """A table in the place of a figure, with further ones folded behind it.

    Attributes:
        also: Further files that it is read from.
        optional: Left out where the report names no such source: then there was none to write.
    """

    title: str
    caption: str
    source: str
    read: Callable[[Evidence, GateReport], Table]
    folded: tuple[Folded, ...] = ()
    also: tuple[str, ...] = ()
    optional: bool = False

    def picture(self, evidence: Evidence, report: GateReport, salt: str) -> dict[str, Any]:
        """What this adds to a `Shown`; a table has no inner names and needs no salt."""
        behind = tuple((item.summary, item.read(evidence, report)) for item in self.folded)
        return {"listed": self.read(evidence, report), "folded": behind}


@dataclass(frozen=True)
class Drawing:
    """One drawing of a series: its title, what is said of it, and what draws it."""

    title: str
    lines: tuple[str, ...]
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Series:
    """Small drawings of one kind, each with its text: `draw(evidence, report)` lists them.

    Attributes:
        also: Further files that they are drawn from.
    """

    title: str
    caption: str
    source: str
    draw: Callable[[Evidence, GateReport], Sequence[Drawing]]
    also: tuple[str, ...] = ()

    def picture(self, evidence: Evidence, report: GateReport, salt: str) -> dict[str, Any]:
        """What this adds to a `Shown`."""
        found = self.draw(evidence, report)
        return {
            "series": tuple(
                Small(item.title, item.lines, drawn(item.draw, item.title, salt=f"{salt}n{number}"))
                for number, item in enumerate(found)
            )
        }


@dataclass(frozen=True)
class Photo:
    """A PNG among the evidence; shown only if the report names these very bytes."""

    title: str
    caption: str
    source: str
    also: tuple[str, ...] = ()

    def picture(self, evidence: Evidence, report: GateReport, salt: str) -> dict[str, Any]:
        """What this adds to a `Shown`; a photo has no inner names and needs no salt.

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


Picturable = Plot | Photo | Listing | Series
"""What a page can be given to show."""


def left_out(plot: Picturable, report: GateReport) -> bool:
    """Whether a report has no such figure, since there was nothing to write."""
    optional = isinstance(plot, Listing | Plot) and plot.optional
    return optional and plot.source not in report.materials


def draw_all(plots: Sequence[Picturable], evidence: Evidence, report: GateReport) -> list[Shown]:
    """Draw what the evidence allows; what is missing is said, never left out in silence."""
    pictures = []
    for index, plot in enumerate(plots):
        sources = (plot.source, *plot.also)
        if left_out(plot, report):
            continue
        try:
            found = plot.picture(evidence, report, f"{report.gate}{index}")
        except (MissingEvidenceError, KeyError, ValueError, TypeError, IndexError) as error:
            found = {"skipped": " ".join(str(error).split())[:200] or type(error).__name__}
        pictures.append(Shown(plot.title, plot.caption, sources, **found))
    return pictures


def in_order(names: Iterable[str]) -> list[str]:
    """Names once each: known methods as in `METHODS`, then the others by name."""
    known = list(METHODS)
    return sorted(
        set(names), key=lambda name: (known.index(name) if name in known else len(known), name)
    )


def colours(names: Iterable[str]) -> dict[str, str]:
    """One colour per name: that of the method, where it is one; others take those that are free."""
    order = in_order(names)
    free = [colour for name, colour in METHODS.items() if name not in order] or [*METHODS.values()]
    others = [name for name in order if name not in METHODS]
    return {name: METHODS[name] for name in order if name in METHODS} | {
        name: free[i % len(free)] for i, name in enumerate(others)
    }


def markers(names: Iterable[str]) -> dict[str, str]:
    """One shape of a point per name, by the same rule as `colours`."""
    shapes = dict(zip(METHODS.values(), MARKERS, strict=True))
    return {name: shapes[colour] for name, colour in colours(names).items()}


def line_looks(names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """How the curve of each name is drawn: none has colour, shape and dash of another.

    A shape belongs to its method in every figure; dashes are fewer than methods, and come again.
    """
    colour, shape, dash = colours(names), markers(names), dashes(names)
    return {
        name: {"color": colour[name], "marker": shape[name], "ls": dash[name], "ms": 4}
        for name in in_order(names)
    }


def dashes(names: Iterable[str]) -> dict[str, Any]:
    """One line style per name, so that curves which coincide can still be told apart."""
    return {name: DASHES[i % len(DASHES)] for i, name in enumerate(in_order(names))}
