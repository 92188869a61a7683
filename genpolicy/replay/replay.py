"""One session of a journal as a file that a 3-D viewer plays: the journal, and a drawing of it."""

from dataclasses import dataclass
from pathlib import Path

from genpolicy.documents.task import IDENTITY
from genpolicy.errors import ConfigError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.replay.bodies import DrawnCell
from genpolicy.replay.journal_file import read_session, write_replay_bytes
from genpolicy.replay.panels import panels
from genpolicy.replay.proposals import Proposals
from genpolicy.replay.timeline import Timeline
from genpolicy.tasks.api import load_task
from genpolicy.verification.journal_source import readable

STAGES_ABOVE = 3
"""A journal lies this many folders below that of all stages, at most."""


@dataclass(frozen=True)
class Written:
    """What a replay holds.

    Attributes:
        session: The session that it shows.
        events: Messages of the journal, copied.
        topics: The topics that were added, with their number of messages.
    """

    session: str
    events: int
    topics: dict[str, int]


def write_replay(journal: Path, out: Path, *, session: str | None, task: str | None) -> Written:
    """Write one session of a journal with the scene drawn beside it; the journal is only read.

    Beside the file stands a layout that opens it (`layout_file`).

    Args:
        journal: The journal.
        out: The MCAP file to write, whole or not at all.
        session: Name of the session; None where the journal has no other.
        task: Name of the task whose cell is drawn; None: that of the ladder in which the journal
            lies.

    Raises:
        BadInputError: Not a whole journal of this version, no such session, or an unwritable place.
        ConfigError: No such task, or none can be known.
        IntegrityError: Journal and tables are not of one run.
    """
    found = read_session(journal, session)
    cell = DrawnCell.of(load_task(task or task_of(journal)))
    with readable(f"{journal}: session {found.session}"):
        proposals = Proposals(journal.parent, found.events[0].event.payload["labels"])
        timeline = Timeline(cell, proposals, found.session)
        drawn = list(timeline.messages(item.event for item in found.events))
        data = write_replay_bytes(found, drawn)
    layout = panels(
        {item.topic for item in drawn} | {channel.topic for channel in found.channels.values()},
        joint_count=cell.collision.kinematics.joint_count,
        workspace=cell.workspace,
    )
    # The layout first: where it cannot be written, no replay says that it is whole.
    write_bytes(layout_file(out), canonical_json(layout))
    write_bytes(out, data)
    topics: dict[str, int] = {}
    for item in drawn:
        topics[item.topic] = topics.get(item.topic, 0) + 1
    return Written(found.session, len(found.events), dict(sorted(topics.items())))


def layout_file(out: Path) -> Path:
    """Where the layout of a replay stands."""
    return out.with_name(f"{out.stem}.layout.json")


def task_of(journal: Path) -> str:
    """Name of the task of the ladder in which a journal lies.

    Raises:
        ConfigError: It lies in none.
        IntegrityError: The ladder's `identity.json` has another form.
    """
    for folder in journal.resolve().parents[1 : STAGES_ABOVE + 1]:
        if (folder / "task" / IDENTITY.file).is_file():
            return IDENTITY.read(folder / "task").name
    raise ConfigError(
        where="--task",
        found="not given",
        expected=f"the task of {journal}, which lies beside no task/{IDENTITY.file}",
        action="Name the task.",
    )
