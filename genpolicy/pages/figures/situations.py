"""Figures of single situations: nearest observations and their actions, the mean and the modes."""

from collections.abc import Sequence
from itertools import chain

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from genpolicy.audit.documents import Obstacle
from genpolicy.pages.figures.drawing import BLUE, GREEN, INK, ORANGE, PURPLE, RED, SKY, new_figure
from genpolicy.pages.figures.plane import Array, Plane, plane_of

FANS = 24
MODES = (BLUE, ORANGE, PURPLE, SKY)
MARKS = ("o", "s", "^", "D")
STONE = "#C3C8D0"
REFUSED, PASSED, UNCHECKED = "refused", "admissible", "not checked"
MEANS = {REFUSED: RED, PASSED: GREEN, UNCHECKED: INK}
Obstacles = Sequence[Obstacle]


class NothingToDrawError(ValueError):
    """The evidence holds nothing that this figure could show."""


def draw_obstacles(axes: Axes, obstacles: Obstacles) -> None:
    """Draw round obstacles as circles, seen from above."""
    for index, item in enumerate(obstacles):
        axes.add_patch(
            Circle(
                (item.x_m, item.y_m),
                item.radius_m,
                facecolor=STONE,
                edgecolor=INK,
                zorder=1,
                label="obstacle" if index == 0 else None,
            )
        )


def clusters(
    examples: pd.DataFrame, *, names: Sequence[str], unit: str, obstacles: Obstacles = ()
) -> Figure:
    """Example situations: above how far the observations lie and what was done, below the chunks.

    Args:
        examples: Rows of `examples.parquet`.
        names: Names of the position's components.
        unit: Their unit; may be empty.
        obstacles: Round obstacles of the scene plane.

    Raises:
        NothingToDrawError: No situation could be analysed.
    """
    numbers = sorted(examples["example"].unique().tolist())
    if not numbers:
        raise NothingToDrawError("no situation had enough comparable demonstrations")
    figure = Figure(figsize=(7.4, 5.0), layout="constrained")
    grid = figure.subplots(2, len(numbers), squeeze=False, sharey="row")
    paths = _paths(examples["path"], len(names))
    plane = plane_of(paths, names, unit, from_above=bool(obstacles))
    for column, number in enumerate(numbers):
        inside = np.flatnonzero(examples["example"].to_numpy() == number)
        part = examples.iloc[inside]
        lines = [plane.line(paths[row]) for row in inside]
        upper, lower = grid[0, column], grid[1, column]
        _near_and_far(upper, part, lines)
        _fan(lower, part, lines, plane, obstacles)
        first = part.iloc[0]
        upper.set_title(
            f"{str(first['query_uuid'])[:8]}, row {int(first['query_index'])}", fontsize=9
        )
        upper.set_xlabel("distance of the observation, scales")
        lower.set_xlabel(plane.x_label)
        if column == 0:
            upper.set_ylabel(f"action chunk, {unit}" if unit else "action chunk")
            lower.set_ylabel(plane.y_label)
    figure.suptitle(
        f"{len(numbers)} held-out situations, phase {examples['phase'].iloc[0]}",
        x=0.01, ha="left", fontsize=10, fontweight="bold",
    )  # fmt: skip
    return figure


def mean_versus_modes(
    frame: pd.DataFrame, *, names: Sequence[str], unit: str, obstacles: Obstacles = ()
) -> Figure:
    """Modal chunks of held-out situations and their mean, with what the feasibility check said.

    Args:
        frame: Rows of `neighbourhoods.parquet` with several modes.
        names: Names of the position's components.
        unit: Their unit; may be empty.
        obstacles: Round obstacles of the scene plane.

    Raises:
        NothingToDrawError: No row.
    """
    total = len(frame)
    if total == 0:
        raise NothingToDrawError("no held-out situation has several modes")
    frame = frame.iloc[np.unique(np.linspace(0, total - 1, FANS).round().astype(int))]
    modes = [_paths(list(flat), len(names)) for flat in frame["mode_paths"]]
    means = _paths(frame["mean_path"], len(names))
    plane = plane_of([*means, *chain.from_iterable(modes)], names, unit, from_above=bool(obstacles))
    figure, (axes,) = new_figure(height=3.7)
    if plane.is_scene:
        draw_obstacles(axes, obstacles)
    verdicts = [_mean_verdict(value) for value in frame["mean_admissible"]]
    for chunks, mean, verdict in zip(modes, means, verdicts, strict=True):
        lines = [plane.line(chunk) for chunk in chunks]
        for line, colour in zip(lines, _by_height(lines), strict=True):
            axes.plot(line[:, 0], line[:, 1], color=colour, alpha=0.55, lw=1.2)
        line = plane.line(mean)
        axes.plot(line[:, 0], line[:, 1], color=MEANS[verdict], ls="--", lw=1.4)
    reasons = sorted({str(reason) for reason in frame["mean_reason"].dropna()} - {""})
    _overlay_legend(axes, plane, verdicts, reasons, most=max(len(chunks) for chunks in modes))
    above = ", from above" if obstacles and plane.is_scene else ""
    axes.set_title(f"{len(frame)} of {total} held-out situations with several modes{above}")
    axes.set_xlabel(plane.x_label)
    axes.set_ylabel(plane.y_label)
    if plane.is_scene:
        axes.set_aspect("equal", adjustable="datalim")
    return figure


def _near_and_far(axes: Axes, part: pd.DataFrame, lines: list[Array]) -> None:
    """Distance of each observation against where its chunk lies between the clusters."""
    labels, coordinate = part["cluster"].to_numpy(), part["coordinate"].to_numpy(dtype=np.float64)
    height = np.array([np.mean(line[:, 1]) for line in lines])
    # The coordinate has no up and down of its own: turn it the way the chunks below are drawn.
    if np.sum((coordinate - coordinate.mean()) * (height - height.mean())) < 0:
        coordinate = -coordinate
    looks = _looks(labels, lines)
    asked = part["is_query"].to_numpy(dtype=bool)
    distance = part["distance"].to_numpy(dtype=np.float64)
    for label, (colour, mark) in looks.items():
        chosen = (labels == label) & ~asked
        axes.plot(
            distance[chosen], coordinate[chosen], mark, color=colour, ms=4, alpha=0.85,
            label=f"{np.count_nonzero(labels == label)} alike",
        )  # fmt: skip
    axes.plot(
        distance[asked], coordinate[asked], "*", color=INK, ms=10, mec="white", mew=0.6,
        label="held-out", zorder=5, clip_on=False,
    )  # fmt: skip
    axes.set_xlim(left=0.0)
    axes.legend(loc="best", fontsize=7, handletextpad=0.2, borderpad=0.2)


def _fan(
    axes: Axes, part: pd.DataFrame, lines: list[Array], plane: Plane, obstacles: Obstacles
) -> None:
    """The chunks themselves, and their mean dashed."""
    labels = part["cluster"].to_numpy()
    looks = _looks(labels, lines)
    for label, line in zip(labels, lines, strict=True):
        axes.plot(line[:, 0], line[:, 1], color=looks[label][0], lw=0.9, alpha=0.6)
    mean = np.mean(lines, axis=0)
    axes.plot(mean[:, 0], mean[:, 1], color=INK, ls="--", lw=1.3)
    if plane.is_scene:
        draw_obstacles(axes, obstacles)
        axes.set_aspect("equal", adjustable="datalim")


def _looks(labels: Array, lines: list[Array]) -> dict[int, tuple[str, str]]:
    """Colour and mark of each cluster, by how high its chunks are drawn."""
    kinds = np.unique(labels)
    height = [
        np.mean([np.mean(line[:, 1]) for k, line in zip(labels, lines, strict=True) if k == kind])
        for kind in kinds
    ]
    order = kinds[np.argsort(-np.asarray(height), kind="stable")]
    return {
        int(kind): (MODES[i % len(MODES)], MARKS[i % len(MARKS)]) for i, kind in enumerate(order)
    }


def _by_height(lines: list[Array]) -> list[str]:
    """Colour of each modal chunk: the highest blue, the lowest orange, the others between."""
    height = np.array([np.mean(line[:, 1] - line[0, 1]) for line in lines])
    rank = np.argsort(np.argsort(-height, kind="stable"), kind="stable")
    last = len(lines) - 1
    return [BLUE if r == 0 else ORANGE if r == last else PURPLE for r in rank]


def _overlay_legend(
    axes: Axes, plane: Plane, verdicts: list[str], reasons: list[str], *, most: int
) -> None:
    name = plane.y_label.partition(",")[0]
    axes.plot([], [], color=BLUE, label=f"mode, to larger {name}")
    if most > 2:
        axes.plot([], [], color=PURPLE, label="mode, between")
    axes.plot([], [], color=ORANGE, label=f"mode, to smaller {name}")
    for verdict, colour in MEANS.items():
        count = verdicts.count(verdict)
        if count or (verdict != UNCHECKED and UNCHECKED not in verdicts):
            text = f"mean, {verdict}: {count} of {len(verdicts)}"
            axes.plot([], [], color=colour, ls="--", label=text)
    title = "means are refused for\n" + "\n".join(reasons[:4]) if reasons else ""
    legend = axes.legend(
        loc="center left", bbox_to_anchor=(1.0, 0.5), title=title, alignment="left"
    )
    legend.get_title().set_fontsize(8)


def _mean_verdict(value: object) -> str:
    if value is None or value is pd.NA or (isinstance(value, float) and np.isnan(value)):
        return UNCHECKED
    return PASSED if bool(value) else REFUSED


def _paths(column: Sequence[Array] | pd.Series, width: int) -> list[Array]:
    """Flat paths as arrays of shape (K, P)."""
    return [np.asarray(flat, dtype=np.float64).reshape(-1, max(width, 1)) for flat in column]
