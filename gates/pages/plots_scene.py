"""What was demonstrated, in Gate A: the cell, and every recorded path by the mode it followed."""

from collections.abc import Iterable
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
from genpolicy.audit.rows import Demonstration
from genpolicy.data.rows import EpisodeRow, FrameRow
from genpolicy.pages.figures.drawing import GREY, RED, new_figure
from genpolicy.pages.figures.situations import MODES, STONE, draw_obstacles

SCENE = f"{AUDIT}/scene.png"
FRAMES = "artifacts/ingest/frames.parquet"
EPISODES = "artifacts/ingest/episodes.parquet"
DEMONSTRATED = f"{AUDIT}/demonstrated.parquet"
SUMMARY_FILE = f"{AUDIT}/{SUMMARY.file}"
POINTS, FEWEST, TOGETHER = 32, 8, 11_520
"""Points kept of a path, at most and at least, and of all: a page of many episodes stays small."""
UNTOLD = "no mode"
"""Episodes that the audit saw near no situation with several modes."""


@dataclass(frozen=True)
class Path:
    """The commanded TCP path of one episode.

    Attributes:
        points_m: Positions in the base frame. Shape (n, 3).
        success: Whether the episode is labelled a success.
        mode: The mode that it followed, by the audit's name.
    """

    points_m: Array
    success: bool
    mode: str


def paths(evidence: Evidence) -> list[Path]:
    """The path of every accepted episode, in the order of the episodes.

    Only the audit says which mode an episode followed: what a mode is depends on the task.

    Raises:
        MissingEvidenceError: No such table or column, or an action without a position.
    """
    modes = {row.episode_uuid: row.mode for row in evidence.records(DEMONSTRATED, Demonstration)}
    frames = evidence.rows(FRAMES, FrameRow, lists=True)
    episodes = evidence.rows(EPISODES, EpisodeRow)
    frames = frames.sort_values(["episode_uuid", "index"], kind="stable")
    positions = np.array(frames["action"].tolist(), dtype=np.float64)[:, :3]
    if positions.shape[1] != 3 or not np.all(np.isfinite(positions)):
        raise MissingEvidenceError(f"{FRAMES} has actions without a finite position")
    rows = pd.Series(np.arange(len(frames))).groupby(frames["episode_uuid"].to_numpy()).indices
    return [
        Path(positions[rows[uuid]], outcome == "success", modes.get(uuid, UNTOLD))
        for uuid, outcome in zip(episodes["episode_uuid"], episodes["outcome"], strict=True)
        if uuid in rows
    ]


def _demonstrations(evidence: Evidence, report: GateReport) -> Figure:
    every = paths(evidence)
    if not every:
        raise MissingEvidenceError(f"{FRAMES} has no rows of an accepted episode")
    obstacles = evidence.document(AUDIT, SUMMARY).obstacles
    points = int(np.clip(TOGETHER // len(every), FEWEST, POINTS))
    figure, (above, aside) = new_figure(height=3.5, columns=2)
    for name, colour in colours(path.mode for path in every).items():
        of_mode = [path for path in every if path.mode == name]
        _draw_paths(above, of_mode, 1, colour, points=points)
        _draw_paths(aside, of_mode, 2, colour, points=points)
        good = sum(path.success for path in of_mode)
        label = f"{name}: {len(of_mode)} episodes, {good} succeed"
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


def colours(modes: Iterable[str]) -> dict[str, str]:
    """One colour per mode, in the order of the names; grey and last where there is none."""
    names = sorted(set(modes), key=lambda name: (name == UNTOLD, name))
    return {
        name: GREY if name == UNTOLD else MODES[place % len(MODES)]
        for place, name in enumerate(names)
    }


def _draw_paths(axes: Axes, chosen: list[Path], second: int, colour: str, *, points: int) -> None:
    lines = [
        path.points_m[np.linspace(0, len(path.points_m) - 1, points).round().astype(int)][
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
        "Commanded tool path of every accepted episode, coloured by the mode that the audit saw it "
        "follow (grey line: none; grey shape: an obstacle; spikes are disturbances and "
        "recoveries). Two separate bundles that both succeed are what a generator is for; one "
        "bundle, or one that fails, is not.",
        FRAMES,
        _demonstrations,
        also=(EPISODES, DEMONSTRATED, SUMMARY_FILE),
    ),
)
