"""Figures of Gate C: rejection waterfall, size of projection, boundary jerk."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError, flags
from gates.feasibility.candidates import admissible
from gates.feasibility.settings import CANDIDATES, HELD_OUT, INTACT, LAYERS
from gates.pages.figures import Plot, colours, dashes, in_order, markers
from gates.pages.limits import draw_limit
from gates.report import GateReport
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.pages.figures.drawing import GREY, HATCHES, in_milli, in_percent, new_figure


def _waterfall(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(CANDIDATES, CandidateRow)
    methods = in_order(frame["method"])
    colour = colours(methods)
    figure, pair = new_figure(height=3.0, columns=2)
    held = (frame["fixture"] == HELD_OUT).to_numpy()
    corrupted = ~frame["fixture"].isin(INTACT).to_numpy()
    for axes, rows, title in zip(
        pair,
        (frame[held], frame[corrupted]),
        ("held-out observations", "corrupted observations"),
        strict=True,
    ):
        width = 0.8 / max(len(methods), 1)
        for rank, method in enumerate(methods):
            part = rows[rows["method"] == method]
            if len(part) == 0:
                continue
            kept = np.ones(len(part), dtype=bool)
            shares = [1.0]
            for layer in LAYERS:
                kept &= flags(part, layer)
                shares.append(float(kept.mean()))
            places = np.arange(len(shares)) - 0.4 + width * (rank + 0.5)
            axes.bar(
                places,
                shares,
                width=width,
                color=colour[method],
                hatch=HATCHES[rank % len(HATCHES)],
                edgecolor="white",
                label=method,
            )
        axes.set_xticks(np.arange(len(LAYERS) + 1), ["drawn", *LAYERS], rotation=40, ha="right")
        axes.set_ylim(0, 1.05)
        in_percent(axes.yaxis)
        axes.set_title(title)
    pair[0].set_ylabel("share still standing")
    figure.legend(*pair[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _admitted(evidence: Evidence, column: str) -> pd.DataFrame:
    frame = evidence.rows(CANDIDATES, CandidateRow)
    frame = frame[(frame["fixture"] == HELD_OUT).to_numpy()]
    frame = frame[admissible(frame) == 1.0].dropna(subset=[column])
    if len(frame) == 0:
        raise MissingEvidenceError("no admissible held-out candidate")
    named: pd.DataFrame = frame.assign(mode=frame["mode"].fillna("").replace("", "unassigned"))
    return named


def _distribution(
    evidence: Evidence, report: GateReport, *, column: str, by: str, label: str, name: str
) -> Figure:
    frame = _admitted(evidence, column)
    colour, dash, shape = colours(frame["method"]), dashes(frame[by]), markers(frame["method"])
    figure, (axes,) = new_figure(height=3.4 if by == "mode" else 2.8)
    for method in in_order(frame["method"]):
        own = frame[frame["method"] == method]
        if by == "mode":
            look = {"color": colour[method], "marker": shape[method], "lw": 2.6}
            _draw_curve(axes, own[column], f"{method} · all", **look)
        for name_of, rows in own.groupby(by):
            text = method if by == "method" else f"{method} · {name_of}"
            look = {"color": colour[method], "marker": shape[method], "lw": 1.2}
            _draw_curve(axes, rows[column], text, ls=dash[str(name_of)], **look)
    axes.axhline(0.95, color=GREY, lw=0.8)
    axes.set_ylim(0, 1.12)
    in_percent(axes.yaxis)
    if column.endswith("_m"):
        in_milli(axes.xaxis)
    draw_limit(axes, report, name)
    axes.set_xlabel(label)
    axes.set_ylabel("share of chunks (line: 95 %)")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _draw_curve(axes: Axes, column: "pd.Series[float]", text: str, **look: Any) -> None:
    """Share of values that are at most this, at 200 of them or fewer; a mark at the median."""
    values = np.sort(np.abs(column.to_numpy(dtype=np.float64)))
    kept = values[np.linspace(0, len(values) - 1, min(len(values), 200)).astype(int)]
    share = np.linspace(1 / len(kept), 1, len(kept))
    axes.step(
        kept, share, where="post", label=f"{text} (n = {len(values)})", ms=4,
        markevery=[len(kept) // 2], **look,
    )  # fmt: skip


def _projection(evidence: Evidence, report: GateReport) -> Figure:
    return _distribution(
        evidence,
        report,
        column="position_change_m",
        by="mode",
        label="change of position by projection, mm",
        name="projection_p95_m",
    )


def _jerk(evidence: Evidence, report: GateReport) -> Figure:
    return _distribution(
        evidence,
        report,
        column="boundary_jerk_m_s3",
        by="method",
        label="jerk at the boundary of chunks, m/s³",
        name="boundary_jerk_p95_m_s3",
    )


PLOTS = (
    Plot(
        "Rejection waterfall",
        "Share of sampled chunks that still stand after each layer, in the order of the layers. "
        "Those of held-out observations should stand to the end, those of corrupted ones fall.",
        CANDIDATES,
        _waterfall,
    ),
    Plot(
        "Size of projection, by mode",
        "Admissible chunks of held-out observations: share that projection moved by at most this "
        "much. Thick: all of a method, which the gate holds against the limit at 95 %. Thin: by "
        "mode; one that lies far to the right is being bent into the feasible set.",
        CANDIDATES,
        _projection,
    ),
    Plot(
        "Jerk at the boundary",
        "Admissible chunks of held-out observations: jerk that the first action asks for after the "
        "last command. Share with at most this much.",
        CANDIDATES,
        _jerk,
    ),
)
