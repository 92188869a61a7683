"""Figures of Gate A about the simpler explanations: separated factors, and what each one earns."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.need.settings import MEASURED_FACTORS
from gates.pages.figures import Plot
from gates.report import GateReport
from gates.words import number, percent, three
from genpolicy.evidence.rows.need import EffectRow
from genpolicy.pages.figures.drawing import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    in_points,
    new_figure,
)

EFFECTS = f"{MEASURED_FACTORS}/effects.parquet"
COLOURS = {
    "reference": GREY,
    "representation": BLUE,
    "trunk": ORANGE,
    "head": PURPLE,
    "temporal": GREEN,
}
PANELS = (
    (("chunk_error", "first_error"), "error, normalised"),
    (("mode_coverage",), "modes covered, points"),
    (("valid_share",), "valid chunks, points"),
)
SHARES = ("mode_coverage", "valid_share")
"""Measures that are shares: in percent, and what they change by in points."""


def _factors(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(EFFECTS, EffectRow)
    places = {factor: place for place, factor in enumerate(COLOURS)}
    frame = frame.assign(place=frame["factor"].map(places).fillna(len(places)))
    frame = frame.sort_values("place", kind="stable")
    order = list(
        dict.fromkeys(zip(frame["variant"], frame["convention"], frame["factor"], strict=True))
    )
    if not order:
        raise MissingEvidenceError(f"{EFFECTS} lists no variants")
    figure, axes = new_figure(height=1.3 + 0.34 * len(order), columns=len(PANELS))
    for panel, (measures, name) in zip(axes, PANELS, strict=True):
        part = frame[frame["measure"].isin(measures)]
        for place, (variant, convention, factor) in enumerate(order):
            row = part[(part["variant"] == variant) & (part["convention"] == convention)]
            if len(row) == 1:
                _draw(panel, place, row.iloc[0].to_dict(), COLOURS.get(factor, INK))
        panel.axvline(0.0, color=INK, lw=0.8)
        panel.set_ylim(len(order) - 0.4, -0.6)
        panel.set_yticks([])
        panel.set_xlabel(f"change of\n{name}\n({_episodes(part)})")
        if set(measures) <= set(SHARES):
            in_points(panel.xaxis)
        panel.margins(x=0.12)
    labels = [f"{factor}: {v.replace('_', ' ')} · {c}" for v, c, factor in order]
    axes[0].set_yticks(np.arange(len(order)), labels)
    for tick, (_, _, factor) in zip(axes[0].get_yticklabels(), order, strict=True):
        tick.set_color(COLOURS.get(factor, INK))
    numbers(frame, "value")
    return figure


def _draw(axes: Axes, place: int, row: Mapping[str, Any], colour: str) -> None:
    if np.isfinite(row["lower"]) and np.isfinite(row["upper"]):
        axes.hlines(place, row["lower"], row["upper"], color=colour, lw=2)
    axes.plot([row["effect"]], [place], "o", color=colour, ms=5)
    value = row["value"]
    axes.annotate(
        percent(value) if row["measure"] in SHARES else three(value), (row["effect"], place),
        xytext=(0, 5), textcoords="offset points", ha="center", fontsize=7, color=INK,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.85},
    )  # fmt: skip


def _episodes(part: pd.DataFrame) -> str:
    """Of how many held-out episodes what a panel shows is the mean."""
    counted = numbers(part, "episodes")
    least, most = number(counted.min(initial=np.inf)), number(counted.max(initial=0.0))
    return f"n = {least if least == most else f'{least} to {most}'} episodes" if len(part) else ""


PLOTS: tuple[Plot, ...] = (
    Plot(
        "What each part earns, changed alone",
        "Point: change against the reference (chunked BC with the MLP encoder and trunk) on the "
        "same held-out episodes (n); line: interval at the ladder's confidence; number: its own "
        "value, a mean over these episodes. Left: distance to the demonstrated chunk, normalised, "
        "for one action that of the first action; a generator is further from any one "
        "demonstration by design. Middle and right: "
        "modes reached, and chunks that reach one and pass all six layers. A point right of zero "
        "in blue or orange is an encoder's or a trunk's merit, not a head's. All variants had the "
        "same short training, one seed.",
        EFFECTS,
        _factors,
    ),
)
