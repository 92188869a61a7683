"""The two clocks: what the checker and the tables say of their windows, against the journals.

Which windows are replayed is drawn by a stream of its own name, so they are drawn again: neither an
episode nor where its window begins can be chosen by whoever writes a journal.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gates.rederive_checked import rederive_checked
from gates.rederive_sessions import TOLERANCE, rederive_sessions
from gates.rederive_shadow import DATASET, TaskSection
from gates.stated import compare_rows, refuse, root_seed, section
from gates.stress.clocks import WALL_CLOCK
from genpolicy.data.dataset import load_dataset
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.integrity.tables import read_table
from genpolicy.tasks.api import Task, load_task
from genpolicy.verification.begun import Begun, begun_sessions
from genpolicy.verification.clocks import derived_windows
from genpolicy.verification.expected import ExpectedSettings
from genpolicy.verification.journal_source import readable
from genpolicy.verification.motion import ExpectedMotion
from genpolicy.wall_clock.bench import WallClockSection, windows
from genpolicy.wall_clock.replay import Replay

WINDOW = ("method", "clock", "episode")
KEYS = {
    "invocations": (*WINDOW, "invocation"),
    "ages": (*WINDOW, "invocation", "row"),
    "ticks": WINDOW,
}


def rederive_clocks(
    root: Path, params: Mapping[str, Any], held_to: tuple[ExpectedSettings, ExpectedMotion]
) -> None:
    """Hold what Gate D prints of the two clocks against their journals; nothing where none ran.

    Args:
        root: Root of the workspace.
        params: `params.yaml`.
        held_to: What every session must have declared, and what every executed row must keep to.

    Raises:
        RefusedError: A row, or a finding of the checker, is not what the journals say, a window
            was made by another policy, or is not the one that is drawn.
        IntegrityError: A file is missing or no regular file.
        BadInputError: A file cannot be read.
    """
    folder = root / WALL_CLOCK
    if not folder.is_dir():
        return
    journals = sorted(folder.glob("journals/*.mcap"))
    rederive_checked(root, "D", WALL_CLOCK, held_to, journals)
    rederive_sessions(root, "D", params, journals, recorded=True)
    _rederive_windows(root, params, journals)
    deadline_s = section(params, "execution", ExecutionSettings).deadline_s
    with readable(f"{WALL_CLOCK}/journals"):
        found = derived_windows(journals, deadline_s=deadline_s)
    for name, keys in KEYS.items():
        path = f"{WALL_CLOCK}/{name}.parquet"
        rows = getattr(found, name)
        compare_rows("D", path, keys, read_table(root / path).to_pylist(), rows, seed=None)


def _rederive_windows(root: Path, params: Mapping[str, Any], journals: Sequence[Path]) -> None:
    """Each journal replays the drawn windows, all of them, in their order."""
    task = load_task(section(params, "task", TaskSection).name)
    drawn = windows(
        load_dataset(root / DATASET), task, section(params, "wall_clock", WallClockSection),
        root_seed=root_seed(params),
    )  # fmt: skip
    planned = [window.episode_uuid for window in drawn]
    for path in journals:
        with readable(f"{path.parent.name}/{path.name}"):
            sessions = begun_sessions(path)
            replayed = [session.labels["episode"] for session in sessions.values()]
        if replayed != planned:
            said, how = ", ".join(replayed) or "nothing", ", ".join(planned) or "nothing"
            refuse("D", f"{path.name}: replays", said, f"{how}, as drawn again")
        for (name, session), window in zip(sessions.items(), drawn, strict=True):
            if not _seen(task, session, window):
                refuse(
                    "D", f"{path.name}: {name}", "asked at another scene",
                    f"a row of the window of {window.episode_uuid} that is drawn again",
                )  # fmt: skip


def _seen(task: Task, session: Begun, window: Replay) -> bool:
    """Whether the scene of the first invocation is that of a row of the window."""
    seen = session.bodies or {}
    for row in window.observation_rows:
        expected = {body: np.concatenate(pose) for body, pose in task.scene_poses(row).items()}
        if set(seen) == set(expected) and all(
            np.allclose(seen[body], expected[body], rtol=0.0, atol=TOLERANCE) for body in expected
        ):
            return True
    return False
