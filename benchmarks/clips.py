"""What a clip of the first page costs, against drawing the same frames with matplotlib.

`python -m benchmarks.clips` prints seconds of CPU and kB of one clip, what `savefig` of matplotlib
takes to draw the same outlines of each frame as PNG, and the ratio. The rollout is a synthetic one
that moves, turns, holds and touches until the time limit of a rollout in `params.yaml`: none of
the ladder's is longer. A clip was planned at 2 s of CPU and 150 kB.
"""

import io
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import yaml
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from gates.pages.clips_drawn import drawn_clip
from genpolicy.contract.action import join_action
from genpolicy.execution.journal import Event, Journal, encode_actions
from genpolicy.replay.bodies import DrawnCell
from genpolicy.replay.film import Film, film_of
from genpolicy.tasks.api import Task, load_task

TICK_HZ = 20
PHASE_TICKS = 40
REPEATS = 5
DPI, WIDE_IN, HIGH_IN = 100, 3.2, 2.4
"""A picture of about the size of a clip on the page: 320 by 240 pixels."""


def planned(root: Path = Path()) -> tuple[str, float]:
    """Task and longest rollout, s, of the parameters."""
    params = yaml.safe_load((root / "params.yaml").read_text(encoding="utf-8"))
    return params["task"]["name"], params["stress"]["episode_limit_s"]


def longest_rollout(limit_s: float) -> list[Event]:
    """Events of a rollout whose hand moves and turns, closed, with a force and an age a tick."""
    journal, ticks = Journal("flow/nominal/0", {}), round(limit_s * TICK_HZ)
    journal.add("scene", 0, {"bodies": {}})
    for row in range(ticks):
        now_ns = row * 1_000_000_000 // TICK_HZ
        if row % PHASE_TICKS == 0:
            journal.add("phase", now_ns, {"event_time_ns": now_ns, "old": "", "new": f"part {row}"})
        payload = {
            "arrival": 0, "chunk_id": "c", "row": row, "sequence": row,
            "age_ns": 200_000_000 + 1_000_000 * (row % 90), "action": _action(row, ticks),
        }  # fmt: skip
        journal.add("accept", now_ns, payload)
        journal.add("force", now_ns, {"force_n": 1.0 + row % 37})
    journal.add("outcome", round(limit_s * 1e9), {"outcome": "success", "mode": "left"})
    return list(journal.events())


def _action(row: int, ticks: int) -> str:
    turn = 0.3 * np.sin(row / 7)
    down = [[np.cos(turn), np.sin(turn), 0.0], [np.sin(turn), -np.cos(turn), 0.0], [0.0, 0.0, -1.0]]
    place = [0.35 + 0.3 * row / ticks, 0.1 * np.sin(row / 20), 0.08 + 0.04 * np.cos(row / 15)]
    return encode_actions(join_action(np.array([place]), np.array([down]), 0.0))


def clip_of(task: Task, cell: DrawnCell, events: list[Event]) -> str:
    """The clip, as it stands in the page."""
    film = film_of(cell, events)
    return str(drawn_clip(film, task.workspace, 1, said="median success of mode left"))


def _pictures(film: Film) -> int:
    """Bytes of a PNG of each frame, from above and from the side, by matplotlib."""
    return sum(map(_picture, _shapes(film)))


def _shapes(film: Film) -> Iterator[list[tuple[np.ndarray, np.ndarray]]]:
    for frame in film.frames:
        scene = [outline for _, outline in frame.scene]
        yield [outline for outline in (*scene, frame.held, frame.hand) if outline is not None]


def _picture(outlines: list[tuple[np.ndarray, np.ndarray]]) -> int:
    figure = Figure(figsize=(WIDE_IN, HIGH_IN), dpi=DPI)
    for side, axes in enumerate(figure.subplots(1, 2)):
        for outline in outlines:
            axes.add_patch(Polygon(outline[side]))
        axes.autoscale_view()
    written = io.BytesIO()
    figure.savefig(written, format="png")
    return len(written.getvalue())


def _cpu_s(work: Callable[[], object], repeats: int) -> float:
    """Least CPU time of several, s: what else runs here adds to it."""
    taken = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        taken.append(time.process_time() - begin)
    return min(taken)


def main() -> None:
    """Print both and their ratio."""
    name, limit_s = planned()
    task = load_task(name)
    cell, events = DrawnCell.of(task), longest_rollout(limit_s)
    film = film_of(cell, events)
    ours = _cpu_s(lambda: clip_of(task, cell, events), REPEATS)
    reference = _cpu_s(lambda: _pictures(film), 1)
    print(
        f"clip of {limit_s:g} s, {len(film.frames)} frames: {ours:.3f} s of CPU, "
        f"{len(clip_of(task, cell, events).encode()) / 1000:.0f} kB; matplotlib savefig of the "
        f"same frames: {reference:.3f} s, {_pictures(film) / 1000:.0f} kB; "
        f"ratio {reference / ours:.1f}"
    )


if __name__ == "__main__":
    main()
