"""A journal that is on disk as it grows, and what is left of one whose process was killed.

Each event is one MCAP record outside of any chunk, handed to the system at the end of a tick: a
process that is killed leaves every whole record, and no summary. `recovered` reads up to the first
record that is not whole; what it found is written again as a whole journal (`write_journal`). A
machine that loses power may lose the last seconds.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from genpolicy.execution.event_schemas import event_schema, schema_name
from genpolicy.execution.journal import (
    EVENT_FIELDS,
    MAXIMUM_CHUNK_BYTES,
    Event,
    Journal,
    write_journal,
)
from genpolicy.execution.supervisor import STOPPED
from genpolicy.integrity.documents import canonical_json

TOPIC = "/journal/"
JOURNAL = "journal.mcap"
"""All sessions of a folder, whole; what the independent checker reads."""


def session_file(folder: Path, number: int) -> Path:
    """Where a session of a folder is written as it grows."""
    return folder / f"session_{number}.mcap"


class StreamedJournal(Journal):
    """A journal of which every event is also written to a file.

    Args:
        session: Name of the rollout.
        path: The file; it must not exist.
        labels: Free text about it.

    Attributes:
        lost: Why the file is no longer written; empty as long as it is.

    Raises:
        OSError: There is such a file, or it cannot be made.
    """

    def __init__(self, session: str, path: Path, labels: Mapping[str, str] | None = None) -> None:
        super().__init__(session, labels)
        self.lost = ""
        self._file = path.open("xb")
        self._writer = Writer(
            self._file, compression=CompressionType.NONE, use_chunking=False,
            enable_data_crcs=True,
        )  # fmt: skip
        self._writer.start(profile="", library="genpolicy")
        self._channels: dict[str, int] = {}
        for kind, fields in EVENT_FIELDS.items():
            schema = canonical_json(event_schema(kind, fields))
            schema_id = self._writer.register_schema(schema_name(kind), "jsonschema", schema)
            self._channels[kind] = self._writer.register_channel(
                f"{TOPIC}{kind}", "json", schema_id
            )
        self._encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False).encode

    def add(self, kind: str, time_ns: int, payload: dict[str, Any]) -> None:
        """Append an event, here and to the file; a file that fails is `lost`, nothing raises."""
        number = len(self)
        super().add(kind, time_ns, payload)
        if self.lost:
            return
        try:
            message = {"session": self.session, "n": number, "t": time_ns, **payload}
            self._writer.add_message(
                self._channels[kind], log_time=max(time_ns, 0),
                data=self._encode(message).encode(), publish_time=max(time_ns, 0),
                sequence=number,
            )  # fmt: skip
        except (OSError, ValueError) as error:
            self.lost = f"{type(error).__name__}: {error}"

    def flush(self) -> None:
        """Hand what was added to the system."""
        try:
            self._file.flush()
        except (OSError, ValueError) as error:
            self.lost = self.lost or f"{type(error).__name__}: {error}"

    def close(self) -> None:
        """Write the summary; the file is whole afterwards."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()
        except (OSError, ValueError) as error:
            self.lost = self.lost or f"{type(error).__name__}: {error}"


def recovered(path: Path) -> list[Event]:
    """Events of one session's file, as far as it is whole; in order."""
    topics: dict[int, str] = {}
    events: list[Event] = []
    with path.open("rb") as stream:
        try:
            for record in StreamReader(stream, record_size_limit=MAXIMUM_CHUNK_BYTES).records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic.removeprefix(TOPIC)
                elif isinstance(record, Message):
                    m = json.loads(record.data)
                    session, n, time_ns = m.pop("session"), m.pop("n"), m.pop("t")
                    events.append(Event(session, n, topics[record.channel_id], time_ns, m))
        except Exception:  # where it was cut off, reading may raise almost anything
            return events
    return events


def sessions_of(folder: Path) -> list[list[Event]]:
    """What the sessions of a folder left, in their order; empty where none was begun."""
    found, number = [], 0
    while (path := session_file(folder, number)).exists():
        found.append(recovered(path))
        number += 1
    return found


def stop_may_stand(events: list[Event]) -> bool:
    """Whether a session left a stop behind: one stood, or its process died before its end."""
    states = [str(e.payload.get("state")) for e in events if e.kind == "supervisor"]
    ended = any(event.kind == "end" for event in events)
    return not ended or (bool(states) and states[-1] in STOPPED)


def collect(folder: Path) -> Path:
    """All sessions of a folder in one whole journal. Returns its path.

    Raises:
        BadInputError: The place cannot be written.
    """
    journals = []
    for events in sessions_of(folder):
        if events:
            journal = Journal(events[0].session)
            for event in events:
                journal.add(event.kind, event.t, event.payload)
            journals.append(journal)
    write_journal(folder / JOURNAL, journals)
    return folder / JOURNAL
