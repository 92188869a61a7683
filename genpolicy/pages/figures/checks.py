"""Figures of the audit's layers: clocks, support, what explains the modes, their success."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from genpolicy.pages.figures.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PALETTE,
    RED,
    SKY,
    in_milli,
    in_percent,
    new_figure,
)
from genpolicy.pages.figures.limits import limit_line
from genpolicy.pages.figures.plane import scatter_of
from genpolicy.pages.figures.situations import NothingToDrawError
from genpolicy.statistics.intervals import clopper_pearson

POINTS = 1200
ROWS = 24
MARKS = "os^Dv<>P"
NO_MODE = "in no mode"


def strata_bars(frame: pd.DataFrame, *, level: float, limit: float | None) -> Figure:
    """Share of the uncertainty about the mode that each recorded variable removes.

    Args:
        frame: Rows of `strata.parquet`.
        level: Adjusted p at most this is significant.
        limit: Largest share that does not explain the modes.

    Raises:
        NothingToDrawError: No variable was tested.
    """
    tested = frame[frame["effect"].notna() & (frame["n"] > 0)]
    if len(tested) == 0:
        raise NothingToDrawError("no variable was tested, because no situation has several modes")
    silent = sorted(set(frame["variable"]) - set(tested["variable"]))
    tested = tested.sort_values(["effect", "variable", "phase"]).tail(ROWS)
    places = np.arange(len(tested))
    adjusted = tested["p_adjusted"].to_numpy(dtype=np.float64)
    figure, (axes,) = new_figure(height=1.0 + 0.22 * len(tested))
    colour = [RED if p <= level else GREY for p in adjusted]
    axes.barh(places, tested["effect"].to_numpy(dtype=np.float64), color=colour, height=0.6)
    lower, upper = (
        tested[f"effect_{end}"].to_numpy(dtype=np.float64) for end in ("lower", "upper")
    )
    axes.hlines(places, lower, upper, color=INK, lw=1.0)
    names = zip(tested["variable"], tested["phase"], strict=True)
    axes.set_yticks(places, [f"{variable} · {phase}" for variable, phase in names])
    in_percent(axes.xaxis)
    if limit is not None:
        limit_line(axes, limit)
    said = f"share of uncertainty removed (red: adjusted p at most {level:g})"
    if silent:
        said += "\ncould not be tested: " + ", ".join(silent[:6])
    axes.set_xlabel(said)
    return figure


def mode_success(frame: pd.DataFrame, *, confidence: float, limit: float | None) -> Figure:
    """Success of each mode with its exact interval.

    Args:
        frame: Rows of `modes.parquet`: mode, phase, episodes, successes.
        confidence: Of the interval.
        limit: Lower end that makes a mode valid.

    Raises:
        NothingToDrawError: No mode was followed over situations.
    """
    frame = frame.sort_values(["phase", "mode"]).tail(ROWS)
    if len(frame) == 0:
        raise NothingToDrawError("no mode was followed over situations")
    trials = frame["episodes"].to_numpy(dtype=np.float64)
    hits = frame["successes"].to_numpy(dtype=np.float64)
    counts = zip(hits, trials, strict=True)
    ends = [clopper_pearson(int(k), int(n), confidence) for k, n in counts]
    figure, (axes,) = new_figure(height=1.0 + 0.24 * len(frame))
    for place, (low, high) in enumerate(ends):
        axes.hlines(place, low, high, color=BLUE, lw=2)
        share = hits[place] / trials[place] if trials[place] else np.nan
        axes.plot([share], [place], "o", color=BLUE, ms=5)
    rows = zip(frame["mode"], frame["phase"], trials, strict=True)
    axes.set_yticks(
        np.arange(len(frame)), [f"{mode} · {phase} (n = {int(n)})" for mode, phase, n in rows]
    )
    axes.set_ylim(-0.7, len(frame) - 0.3)
    axes.set_xlim(0, 1.02)
    in_percent(axes.xaxis)
    if limit is not None:
        limit_line(axes, limit)
    axes.set_xlabel(f"share of successful episodes, exact {100 * confidence:g} % interval")
    return figure


def label_agreement(frame: pd.DataFrame) -> Figure:
    """Replayed episodes by mode: how many labels the replay confirms, and how many it turns over.

    Args:
        frame: Rows of `replay.parquet`: mode (may be missing), label, replayed.

    Raises:
        NothingToDrawError: Nothing was replayed.
    """
    if len(frame) == 0:
        raise NothingToDrawError("no episode was replayed")
    modes = frame["mode"].astype(object).where(frame["mode"].notna(), NO_MODE)
    names = sorted(set(modes))[:ROWS]
    label, replayed = (frame[name] == "success" for name in ("label", "replayed"))
    agree = frame["label"] == frame["replayed"]
    kinds = (
        ("label agrees", agree, GREY, ""),
        ("labelled success, replay fails", ~agree & label, RED, "//"),
        ("labelled failure, replay succeeds", ~agree & replayed, SKY, ".."),
    )
    figure, (axes,) = new_figure(height=1.3 + 0.28 * len(names))
    left = np.zeros(len(names))
    for text, chosen, colour, hatch in kinds:
        counts = np.array([np.count_nonzero(chosen & (modes == name)) for name in names])
        axes.barh(
            np.arange(len(names)), counts, left=left, color=colour, hatch=hatch, height=0.6,
            edgecolor="white", label=f"{text} ({counts.sum()})",
        )  # fmt: skip
        left = left + counts
    axes.set_yticks(np.arange(len(names)), names)
    axes.invert_yaxis()
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("replayed episodes")
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def realignment(
    frame: pd.DataFrame, *, limit_s: float, modes_before: int, modes_after: int
) -> Figure:
    """Clock of every episode against the others, before and after realignment.

    Args:
        frame: Rows of `alignment.parquet`.
        limit_s: Largest offset that is no defect, s.
        modes_before: Held-out episodes with several modes on the data as they are.
        modes_after: The same on realigned data.

    Raises:
        NothingToDrawError: No episode's clock could be measured.
    """
    known = frame[frame["offset_before_s"].notna()]
    if len(known) == 0:
        raise NothingToDrawError(
            "no lag could be measured: the action commands nothing that is observed, or nothing "
            "moves"
        )
    known = known.sort_values(["order", "episode_uuid"])
    keep = np.unique(np.linspace(0, len(known) - 1, POINTS // 2).round().astype(int))
    known = known.iloc[keep]
    figure, (before, after) = new_figure(height=2.9, columns=2)
    after.sharey(before)
    epochs = sorted(known["epoch"].unique().tolist())
    for axes, column in ((before, "offset_before_s"), (after, "offset_after_s")):
        axes.axhspan(-limit_s, limit_s, color=GREY, alpha=0.15, lw=0, label="within the limit")
        for number, epoch in enumerate(epochs):
            part = known[known["epoch"] == epoch]
            name = "episode" if not epoch else epoch if "epoch" in epoch else f"epoch {epoch}"
            axes.plot(
                part["order"], part[column], MARKS[number % len(MARKS)], ms=3.5, alpha=0.8,
                color=PALETTE[number % len(PALETTE)], label=name,
            )  # fmt: skip
        axes.set_xlabel("recording order")
    before.set_title(f"as recorded: {modes_before} episodes with several modes", fontsize=9)
    after.set_title(f"realigned: {modes_after} episodes with several modes", fontsize=9)
    before.set_ylabel("clock offset, ms")
    in_milli(before.yaxis)
    handles, labels = before.get_legend_handles_labels()
    figure.legend(handles[:9], labels[:9], loc="outside lower center", ncols=5)
    return figure


def support_map(frame: pd.DataFrame, *, names: Sequence[str], unit: str, limit: float) -> Figure:
    """Where the held-out situations lie, and where too few training episodes came near.

    Args:
        frame: Rows of `support.parquet`.
        names: Names of the position's components.
        unit: Their unit; may be empty.
        limit: Smallest share of situations with enough neighbours.

    Raises:
        NothingToDrawError: No query was made.
    """
    if len(frame) == 0:
        raise NothingToDrawError("no held-out situation was asked about")
    figure = Figure(figsize=(7.4, 3.2), layout="constrained")
    axes, bars = figure.subplots(1, 2, width_ratios=(3, 2))
    shown = frame.iloc[np.unique(np.linspace(0, len(frame) - 1, POINTS).round().astype(int))]
    positions = np.array([np.asarray(p, dtype=np.float64) for p in shown["position"]])
    if positions.shape[1] > 1:
        places, x_label, y_label = scatter_of(positions, names, unit)
    else:
        index = shown["index"].to_numpy(dtype=np.float64)
        places = np.stack([index, positions[:, 0]], axis=1)
        x_label, y_label = "row of the episode", f"{names[0]}, {unit}" if unit else names[0]
    reached = shown["analysed"].to_numpy(dtype=bool)
    several = shown["two_mode"].to_numpy(dtype=bool)
    total = np.array([np.sum(frame["analysed"]), np.sum(frame["two_mode"])], dtype=np.int64)
    for chosen, mark, colour, size, text, count in (
        (reached & ~several, "o", GREY, 2.5, "one mode", total[0] - total[1]),
        (several, "o", BLUE, 3.5, "several modes", total[1]),
        (~reached, "x", RED, 4.0, "too few neighbours", len(frame) - total[0]),
    ):
        axes.plot(
            places[chosen, 0], places[chosen, 1], mark, color=colour, ms=size, alpha=0.7,
            label=f"{text} ({count})",
        )  # fmt: skip
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, columnspacing=1.0)
    table = frame.groupby("phase", sort=True)["analysed"].agg(["sum", "size"]).tail(ROWS)
    share = (table["sum"] / table["size"]).to_numpy(dtype=np.float64)
    bars.barh(np.arange(len(table)), share, color=ORANGE, height=0.6)
    bars.set_yticks(
        np.arange(len(table)), [f"{phase} (n = {n})" for phase, n in table["size"].items()]
    )
    bars.set_ylim(-0.8, max(len(table), 3) - 0.2)
    bars.set_xlim(0, 1.02)
    in_percent(bars.xaxis)
    limit_line(bars, limit)
    bars.set_xlabel("share with enough neighbours")
    return figure
