"""Figures of Gate C: rejection waterfall, size of projection, boundary jerk."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError, flags
from gates.gate_c import CANDIDATES, HELD_OUT, LAYERS, admissible
from gates.models import GateReport
from gates.render.figures import HATCHES, Plot, colours, dashes, in_order, new_figure
from gates.render.limits import draw_limit


def _waterfall(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.frame(CANDIDATES, "method", "fixture", *LAYERS)
    methods = in_order(frame["method"])
    colour = colours(methods)
    figure, pair = new_figure(height=3.0, columns=2)
    held = (frame["fixture"] == HELD_OUT).to_numpy()
    for axes, rows, title in zip(
        pair,
        (frame[held], frame[~held]),
        ("held-out observations", "corrupted observations"),
        strict=True,
    ):
        width = 0.8 / max(len(methods), 1)
        for rank, method in enumerate(methods):
            part = rows[rows["method"] == method]
            if len(part) == 0:
                continue
            standing = np.ones(len(part), dtype=bool)
            shares = [1.0]
            for layer in LAYERS:
                standing &= flags(part, layer)
                shares.append(float(standing.mean()))
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
        axes.set_title(title)
    pair[0].set_ylabel("share still standing")
    figure.legend(*pair[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _curve(evidence: Evidence, column: str, by: str) -> pd.DataFrame:
    frame = evidence.frame(CANDIDATES, "method", "mode", "fixture", column, *LAYERS)
    frame = frame[(frame["fixture"] == HELD_OUT).to_numpy()]
    frame = frame[admissible(frame) == 1.0].dropna(subset=[column])
    if len(frame) == 0:
        raise MissingEvidenceError("no admissible held-out candidate")
    frame = frame.assign(mode=frame["mode"].fillna("").replace("", "unassigned"))
    lines: pd.DataFrame = frame.assign(
        line=frame["method"] + (" · " + frame["mode"] if by == "mode" else "")
    )
    return lines


def _distribution(
    evidence: Evidence, report: GateReport, *, column: str, by: str, label: str, name: str
) -> Figure:
    frame = _curve(evidence, column, by)
    colour, dash = colours(frame["method"]), dashes(frame[by])
    figure, (axes,) = new_figure(height=2.8)
    ordered = [
        line
        for method in in_order(frame["method"])
        for line in sorted(set(frame.loc[frame["method"] == method, "line"]))
    ]
    for line in ordered:
        rows = frame[frame["line"] == line]
        look = {"color": colour[rows["method"].iloc[0]], "ls": dash[rows[by].iloc[0]]}
        values = np.sort(np.abs(rows[column].to_numpy(dtype=np.float64)))
        kept = values[np.linspace(0, len(values) - 1, min(len(values), 200)).astype(int)]
        share = np.linspace(1 / len(kept), 1, len(kept))
        axes.step(kept, share, where="post", label=f"{line} (n = {len(values)})", **look)
    draw_limit(axes, report, name)
    axes.set_xlabel(label)
    axes.set_ylabel("share of candidates")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _projection(evidence: Evidence, report: GateReport) -> Figure:
    return _distribution(
        evidence,
        report,
        column="position_change_m",
        by="mode",
        label="change of position by projection, m",
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
        "much. A mode whose curve lies far to the right is being bent into the feasible set.",
        CANDIDATES,
        _projection,
    ),
    Plot(
        "Jerk at the seam",
        "Admissible chunks of held-out observations: jerk that the first action asks for after the "
        "last command. Share with at most this much.",
        CANDIDATES,
        _jerk,
    ),
)
