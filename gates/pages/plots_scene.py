"""What was demonstrated, in Gate A: the cell, and every recorded path around its obstacle."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from gates.evidence import Array, Evidence, MissingEvidenceError
from gates.need.settings import AUDIT
from gates.pages.figures import Photo, Plot
from gates.report import GateReport
from genpolicy.audit.documents import SUMMARY
from genpolicy.data.rows import EpisodeRow, FrameRow
from genpolicy.pages.figures.drawing import BLUE, GREY, ORANGE, RED, new_figure
from genpolicy.pages.figures.situations import STONE, draw_obstacles

SCENE = f"{AUDIT}/scene.png"
FRAMES = "artifacts/ingest/frames.parquet"
EPISODES = "artifacts/ingest/episodes.parquet"
SUMMARY_FILE = f"{AUDIT}/{SUMMARY.file}"
POINTS = 32
"""Points kept of each path; the recorded ones lie a few millimetres apart."""
LEFT, RIGHT, BETWEEN = "left", "right", "does not pass"
SIDES = {LEFT: BLUE, RIGHT: ORANGE, BETWEEN: GREY}


@dataclass(frozen=True)
class Path:
    """The commanded TCP path of one episode.

    Attributes:
        points_m: Positions in the base frame. Shape (n, 3).
        success: Whether the episode is labelled a success.
    """

    points_m: Array
    success: bool


def side(points_m: Array, x_m: float, y_m: float) -> str:
    """Side on which a path first passes a place: `left` at larger y, `right` at smaller y.

    Args:
        points_m: Path. Shape (n, 3).
        x_m: Where the obstacle stands; paths come from smaller x.
        y_m: Where the obstacle stands.
    """
    beyond = np.flatnonzero(points_m[:, 0] >= x_m)
    if len(beyond) == 0 or beyond[0] == 0:
        return BETWEEN
    return LEFT if points_m[beyond[0], 1] > y_m else RIGHT


def paths(evidence: Evidence) -> list[Path]:
    """The path of every accepted episode, in the order of the episodes.

    Raises:
        MissingEvidenceError: No such table or column, or an action without a position.
    """
    frames = evidence.rows(FRAMES, FrameRow, lists=True)
    episodes = evidence.rows(EPISODES, EpisodeRow)
    frames = frames.sort_values(["episode_uuid", "index"], kind="stable")
    positions = np.array(frames["action"].tolist(), dtype=np.float64)[:, :3]
    if positions.shape[1] != 3 or not np.all(np.isfinite(positions)):
        raise MissingEvidenceError(f"{FRAMES} has actions without a finite position")
    rows = pd.Series(np.arange(len(frames))).groupby(frames["episode_uuid"].to_numpy()).indices
    return [
        Path(positions[rows[uuid]], outcome == "success")
        for uuid, outcome in zip(episodes["episode_uuid"], episodes["outcome"], strict=True)
        if uuid in rows
    ]


def _demonstrations(evidence: Evidence, report: GateReport) -> Figure:
    every = paths(evidence)
    if not every:
        raise MissingEvidenceError(f"{FRAMES} has no rows of an accepted episode")
    obstacles = evidence.document(AUDIT, SUMMARY).obstacles
    first = next(iter(obstacles), None)
    if first is None:
        sides = [BETWEEN] * len(every)
    else:
        sides = [side(path.points_m, first.x_m, first.y_m) for path in every]
    figure, (above, aside) = new_figure(height=3.5, columns=2)
    for name, colour in SIDES.items():
        of_side = [path for path, one in zip(every, sides, strict=True) if one == name]
        if not of_side:
            continue
        _draw_paths(above, of_side, 1, colour)
        _draw_paths(aside, of_side, 2, colour)
        good = sum(path.success for path in of_side)
        label = f"{name}: {len(of_side)} episodes, {good} succeed"
        above.plot([], [], color=colour, lw=2, label=label)
    failed = np.array([path.points_m[-1] for path in every if not path.success]).reshape(-1, 3)
    for axes, second in ((above, 1), (aside, 2)):
        axes.scatter(failed[:, 0], failed[:, second], marker="x", s=22, color=RED, lw=1.2, zorder=6)
        axes.set_xlabel("x, m (base frame)")
    above.scatter([], [], marker="x", s=22, color=RED, label=f"end of a failure ({len(failed)})")
    draw_obstacles(above, obstacles)
    for item in obstacles:
        low, high = aside.get_ylim()
        corner = (item.x_m - item.radius_m, low)
        aside.add_patch(
            Rectangle(corner, 2 * item.radius_m, high - low, color=STONE, alpha=0.6, lw=0, zorder=1)
        )
    above.set_title("from above")
    aside.set_title("from the side")
    above.set_aspect("equal", adjustable="datalim")
    above.set_ylabel("y, m")
    aside.set_ylabel("z, m")
    figure.legend(loc="outside lower center", ncols=4)
    return figure


def _draw_paths(axes: Axes, chosen: list[Path], second: int, colour: str) -> None:
    lines = [
        path.points_m[np.linspace(0, len(path.points_m) - 1, POINTS).round().astype(int)][
            :, [0, second]
        ]
        for path in chosen
    ]
    axes.add_collection(LineCollection(lines, colors=colour, linewidths=0.7, alpha=0.4))
    axes.autoscale_view()


PLOTS: tuple[Plot | Photo, ...] = (
    Photo(
        "The cell",
        "The simulated cell at one drawn start, ray cast from the file that also simulates it, "
        "gives the arm its kinematics and finds its collisions. A drawing, not a photograph.",
        SCENE,
    ),
    Plot(
        "What was demonstrated",
        "Commanded tool path of every accepted episode, coloured by the side on which it passes "
        "the obstacle (grey; spikes are disturbances and recoveries). Two separate bundles that "
        "both succeed are what a generator is for; one bundle, or one that fails, is not.",
        FRAMES,
        _demonstrations,
        also=(EPISODES, SUMMARY_FILE),
    ),
)
