"""What the figures and tables of a gate's page show, as numbers that can be held against a version.

An SVG has the same bytes for the same data, but a hash of it says only that something moved. Here
every artist of a figure says where it stands: bars, curves, dots, texts, ticks, limits of axes.
"""

import json
import re
from dataclasses import asdict
from html import unescape
from typing import Any

import numpy as np
from as_told import hold
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.desk import desk_of
from gates.pages.figures import Folded, Listing, Plot, Series, left_out
from gates.pages.page import PLOTS, gate_page

HASH = re.compile(r"\b[0-9a-f]{7,64}\b|^\d+\.\d+\.\d+(\+\w+)?$")
LONGEST = 12
"""Numbers of a series that are kept as they are; of a longer one its sums are kept."""


def hold_pictures(name, gate, root, report) -> None:
    """Compare what the page of a gate would draw from evidence with the version of that name."""
    found = Evidence(root)
    plots = [plot for plot in PLOTS[gate] if not left_out(plot, report)]
    shown = {plot.title: _said_of(plot, found, report) for plot in plots}
    desk = asdict(desk_of({gate: report}))
    page = _words(gate_page(root, report))
    whole = {"figures": shown, "desk": desk, "page": page}
    hold(name, json.loads(json.dumps(whole, default=lambda item: item.id)))


def _words(page: str) -> list[str]:
    """Lines of a page that somebody reads, without hashes and versions of libraries."""
    for kind in ("svg", "style", "script", "head"):
        page = re.sub(rf"<{kind}\b.*?</{kind}>", "", page, flags=re.DOTALL)
    lines = [re.sub(r"\s+", " ", unescape(line)).strip() for line in re.split(r"<[^>]*>", page)]
    return [HASH.sub("#", line) for line in lines if line]


def _said_of(plot, found, report) -> Any:
    try:
        return _of(plot, found, report)
    except MissingEvidenceError as error:
        return f"not drawn: {error}"


def _of(plot, found, report) -> Any:
    if isinstance(plot, Plot):
        words = plot.read(found, report) if plot.read else ()
        return {"drawn": _figure(plot.draw(found, report)), "in words": _table(words)}
    if isinstance(plot, Series):
        drawings = plot.draw(found, report)
        return {
            f"{n} {d.title}": [list(d.lines), _figure(d.draw())] for n, d in enumerate(drawings)
        }
    if isinstance(plot, Listing | Folded):
        behind = {item.summary: _of(item, found, report) for item in getattr(plot, "folded", ())}
        return {"table": _table(plot.read(found, report)), "folded": behind}
    return plot.source


def _table(rows) -> list[str]:
    return [" | ".join(row) for row in rows]


def _figure(figure: Figure) -> dict[str, Any]:
    legend = [text.get_text() for item in figure.legends for text in item.get_texts()]
    return {f"axes {n}": _axes(axes) for n, axes in enumerate(figure.axes)} | {"legend": legend}


def _axes(axes) -> dict[str, Any]:
    own = axes.get_legend()
    return {
        "title": [axes.get_title(loc="left"), axes.get_title()],
        "labels": [axes.get_xlabel(), axes.get_ylabel()],
        "scales": [axes.get_xscale(), axes.get_yscale(), str(axes.get_aspect())],
        "limits": _numbers([*axes.get_xlim(), *axes.get_ylim()]),
        "ticks": [t.get_text() for a in (axes.xaxis, axes.yaxis) for t in a.get_ticklabels()
                  if a.get_major_formatter().__class__.__name__ == "FixedFormatter"],
        "legend": [text.get_text() for text in own.get_texts()] if own else [],
        "lines": [_line(item) for item in axes.lines],
        "patches": [_patch(item) for item in axes.patches],
        "groups": [_group(item) for item in axes.collections],
        "texts": [[t.get_text(), _numbers(t.get_position()), to_hex(t.get_color())]
                  for t in axes.texts],
    }  # fmt: skip


def _line(item) -> list[Any]:
    look = [to_hex(item.get_color()), item.get_linestyle(), item.get_linewidth(), item.get_marker()]
    rows = np.asarray(item.get_xydata(), dtype=float)
    return [str(item.get_label()), look, item.get_drawstyle(), _numbers(rows)]


def _patch(item) -> list[Any]:
    look = [to_hex(item.get_facecolor()), item.get_hatch() or "", item.get_linewidth()]
    path = item.get_path().transformed(item.get_patch_transform())
    return [str(item.get_label()), look, _numbers(path.vertices)]


def _group(item: Collection) -> list[Any]:
    look = sorted({to_hex(c) for c in (*item.get_facecolor(), *item.get_edgecolor())})
    corners = [path.vertices for path in item.get_paths()]
    places = np.asarray(item.get_offsets(), dtype=float)
    return [
        str(item.get_label()), look, [float(w) for w in np.atleast_1d(item.get_linewidths())][:3],
        len(corners), _numbers(np.concatenate(corners) if corners else ()), _numbers(places),
    ]  # fmt: skip


def _numbers(values) -> list[Any]:
    """The numbers, or of many how many there are, both ends and sums that every one moves."""
    flat = np.asarray(values, dtype=float).reshape(-1)
    if len(flat) <= LONGEST:
        return flat.tolist()
    place = np.arange(1, len(flat) + 1)
    sums = [np.nansum(flat), np.nansum(flat * place), np.nansum(np.abs(np.diff(flat)))]
    return [len(flat), flat[0], flat[-1], *(float(s) for s in sums)]
