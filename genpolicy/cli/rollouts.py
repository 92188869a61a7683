"""`genpolicy export rollout`: one rollout of Gate D, to be watched or shown."""

import re
from pathlib import Path
from typing import Literal

from genpolicy.cli.replay import check_out, run_replay
from genpolicy.errors import BadInputError, ConfigError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.replay.bodies import DrawnCell
from genpolicy.replay.film import film_of
from genpolicy.replay.gif import film_gif
from genpolicy.replay.journal_file import JournalFile, read_session
from genpolicy.replay.replay import task_of
from genpolicy.replay.rerun_form import write_rerun
from genpolicy.tasks.api import Task, load_task
from genpolicy.verification.journal_source import readable

JOURNALS = Path("artifacts", "stress", "journals")
FOUND, BY_SEARCH = Path("artifacts", "failure_search", "journals"), "@search"
"""Where rollouts of the failure search lie, and what their conditions end in."""
FORM = "METHOD/CONDITION/START"
SAID_OF = 5
"""Journals that a message names."""


def run_export_rollout(
    rollout: str,
    out: Path,
    *,
    to: Literal["foxglove", "gif", "rerun"],
    root: Path,
    task: str | None,
    force: bool,
) -> int:
    """Write a rollout in another form, and print what was written.

    Args:
        rollout: Its name, `METHOD/CONDITION/START`.
        out: The file to write.
        to: The form.
        root: The workspace in which it was run.
        task: Name of the task; None: that of the ladder.
        force: Whether an old file may be replaced.

    Raises:
        BadInputError: There is no such rollout, its journal is not whole, or the place is wrong.
        ConfigError: The library of the form is not installed.
    """
    journal = journal_of(rollout, root)
    if to == "foxglove":
        return run_replay(journal, out, session=rollout, task=task, force=force)
    check_out(journal, out, force=force)
    if to == "rerun":
        counts = write_rerun(journal, out, session=rollout, task=task)
        print(f"rerun     {out}")
        for place, count in counts.items():
            print(f"logged    {place} ({count})")
        return 0
    found, cell = read_session(journal, rollout), load_task(task or task_of(journal))
    data, frames = _gif(found, cell)
    write_bytes(out, data)
    print(f"gif       {out} ({len(data) / 1e3:.0f} kB, {frames} moments)")
    print(f"session   {rollout}")
    return 0


def journal_of(rollout: str, root: Path) -> Path:
    """The journal of Gate D, or of the failure search behind it, that holds a rollout.

    Raises:
        ConfigError: No name of a rollout.
        BadInputError: No such journal.
    """
    method, _, rest = rollout.partition("/")
    condition, _, start = rest.partition("/")
    names = (method, condition, start)
    if not all(re.sub(r"[-_@.]", "", name).isalnum() for name in names):
        raise ConfigError(
            where="ROLLOUT",
            found=repr(rollout),
            expected=f"{FORM}, as `flow/push/0`",
            action="Name one; the first page names those that it shows.",
        )
    folder = root / (FOUND if condition.endswith(BY_SEARCH) else JOURNALS)
    path = folder / f"{method}__{condition}.mcap"
    if not path.is_file():
        there = sorted(p.stem.replace("__", "/") for p in folder.glob("*__*.mcap"))
        some = ", ".join(there[:SAID_OF]) + f" and {len(there) - SAID_OF} more" * (
            len(there) > SAID_OF
        )
        raise BadInputError(
            where=str(path),
            found="missing",
            expected=f"a journal of Gate D; there {'are ' + some if there else 'is none'}",
            action=f"Name one of them with a start, as {there[0]}/0."
            if there
            else "Run `make ladder`: gate D has to be reached, "
            "or name another workspace by --root.",
        )
    return path


def _gif(found: JournalFile, task: Task) -> tuple[bytes, int]:
    with readable(f"session {found.session}"):
        film = film_of(DrawnCell.of(task), [item.event for item in found.events])
        ended = [item.event.payload for item in found.events if item.event.kind == "outcome"]
    said = found.session + "".join(f": {payload['outcome']}" for payload in ended)
    return film_gif(film, task.workspace, said=said.replace("_", " ")), len(film.frames)
