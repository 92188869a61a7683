"""A journal's file with every byte of its messages, and the file that a replay is written into.

The schemas of its channels are written anew: those of older journals are none that a viewer reads.
"""

import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.writer import CompressionType, Writer

from genpolicy.errors import BadInputError
from genpolicy.execution.event_schemas import event_schema, schema_name
from genpolicy.execution.journal import (
    EVENT_FIELDS,
    JOURNAL_VERSION,
    MAXIMUM_CHUNK_BYTES,
    MAXIMUM_UNCOMPRESSED_BYTES,
    Event,
)
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes_of
from genpolicy.replay.messages import SCHEMAS, Json

TOPIC = "/journal/"
NAMES_SAID = 5
"""Sessions that a message names; a shadow test has thousands."""


@dataclass(frozen=True)
class Recorded:
    """One event with the message that it was read from.

    Attributes:
        event: The event.
        message: Its message, byte for byte.
        channel: Number of its channel in the file.
    """

    event: Event
    message: Message
    channel: int


@dataclass(frozen=True)
class JournalFile:
    """One session of a journal file.

    Attributes:
        session: Its name.
        channels: Of the file, by number.
        events: Of the session, in order.
    """

    session: str
    channels: dict[int, Channel]
    events: list[Recorded]


@dataclass(frozen=True)
class Drawn:
    """A message that a replay adds.

    Attributes:
        topic: Its topic.
        schema: Name of its schema.
        time_ns: Its time on the journal's clock, ns.
        content: The message.
    """

    topic: str
    schema: str
    time_ns: int
    content: Json


def read_session(path: Path, name: str | None) -> JournalFile:
    """One session of a journal.

    Args:
        path: The journal.
        name: Name of the session; None where the journal has no other.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal of this version, no such session, or none is named and
            there are several.
    """
    _, data = sha256_bytes_of(path, keep=True)
    sessions: dict[str, list[Recorded]] = {}
    try:
        reader = make_reader(io.BytesIO(data), validate_crcs=True)
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            raise ValueError("no summary")
        sizes = [index.uncompressed_size for index in summary.chunk_indexes]
        if sum(sizes) > MAXIMUM_UNCOMPRESSED_BYTES or max(sizes, default=0) > MAXIMUM_CHUNK_BYTES:
            raise ValueError(f"{sum(sizes)} bytes uncompressed, {max(sizes)} in one piece")
        for _, channel, message in reader.iter_messages(log_time_order=False):
            event = _event(channel.topic, message)
            sessions.setdefault(event.session, []).append(Recorded(event, message, channel.id))
        if not sessions:
            raise ValueError("no event")
    except Exception as error:  # damaged bytes make the readers below raise almost anything
        raise BadInputError(
            where=str(path),
            found=f"no journal ({type(error).__name__}: {error})",
            expected="a whole MCAP journal",
            action="Name the journal.mcap of shadow, or one of stress/journals.",
        ) from error
    chosen = _chosen(path, sessions, name)
    _require_version(path, sessions[chosen])
    return JournalFile(chosen, dict(summary.channels), sessions[chosen])


def write_replay_bytes(journal: JournalFile, drawn: Iterable[Drawn]) -> bytes:
    """A replay as the bytes of an MCAP file; the same input gives the same bytes.

    The channels of the journal keep their numbers' order and names, its messages their bytes,
    times and numbers. Each message that is drawn follows the events of its time.

    Args:
        journal: The session.
        drawn: What is added, in the order of time.
    """
    buffer = io.BytesIO()
    writer = Writer(buffer, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile="", library="genpolicy")
    own = _register_journal(writer, journal)
    added: dict[str, int] = {}
    schemas: dict[str, int] = {}
    encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False).encode
    waiting = sorted(drawn, key=lambda item: item.time_ns)
    for item in waiting:  # all channels before all messages: the viewer lists them in this order
        if item.schema not in schemas:
            schemas[item.schema] = writer.register_schema(
                item.schema, "jsonschema", canonical_json(SCHEMAS[item.schema])
            )
        if item.topic not in added:
            added[item.topic] = writer.register_channel(item.topic, "json", schemas[item.schema])
    counts = dict.fromkeys(added, 0)
    for message, channel, content in _merged(journal.events, waiting):
        if message is not None:
            writer.add_message(
                own[channel],
                log_time=message.log_time,
                data=message.data,
                publish_time=message.publish_time,
                sequence=message.sequence,
            )
        elif content is not None:
            writer.add_message(
                added[content.topic],
                log_time=content.time_ns,
                data=encode(content.content).encode(),
                publish_time=content.time_ns,
                sequence=counts[content.topic],
            )
            counts[content.topic] += 1
    writer.finish()  # type: ignore[no-untyped-call]
    return buffer.getvalue()


def _register_journal(writer: Writer, journal: JournalFile) -> dict[int, int]:
    """Number of each channel of the journal in the new file."""
    found = {}
    for number, channel in sorted(journal.channels.items()):
        kind = channel.topic.removeprefix(TOPIC)
        if kind not in EVENT_FIELDS:  # without a message, or reading it would have been refused
            continue
        schema = canonical_json(event_schema(kind, EVENT_FIELDS[kind]))
        found[number] = writer.register_channel(
            channel.topic,
            channel.message_encoding,
            writer.register_schema(schema_name(kind), "jsonschema", schema),
            dict(channel.metadata),
        )
    return found


def _merged(
    events: Sequence[Recorded], drawn: Sequence[Drawn]
) -> Iterable[tuple[Message | None, int, Drawn | None]]:
    """Events and drawn messages by time; of one time the events first."""
    place = 0
    for number, item in enumerate(events):
        yield item.message, item.channel, None
        following = events[number + 1].message.log_time if number + 1 < len(events) else None
        while place < len(drawn) and (following is None or drawn[place].time_ns < following):
            yield None, 0, drawn[place]
            place += 1


def _event(topic: str, message: Message) -> Event:
    """The event of a message.

    Raises:
        ValueError: It is none; so are the errors of other types that a strange one raises.
    """
    kind = topic.removeprefix(TOPIC)
    if not topic.startswith(TOPIC) or kind not in EVENT_FIELDS:
        raise ValueError(f"a message on {topic} that is no journal event")
    payload = json.loads(message.data)
    session, n, time_ns = payload.pop("session"), payload.pop("n"), payload.pop("t")
    if not isinstance(session, str) or message.log_time != max(time_ns, 0):
        raise ValueError(f"log_time {message.log_time} of an event at {time_ns}")
    return Event(session, n, kind, time_ns, payload)


def _chosen(path: Path, sessions: dict[str, list[Recorded]], name: str | None) -> str:
    if name is None and len(sessions) == 1:
        return next(iter(sessions))
    if name in sessions:
        return name
    some = ", ".join(list(sessions)[:NAMES_SAID])
    rest = len(sessions) - NAMES_SAID
    raise BadInputError(
        where=f"--session of {path}",
        found="not given" if name is None else repr(name),
        expected=f"one of {len(sessions)} sessions ({some}{f' and {rest} more' * (rest > 0)})",
        action="Name one: each begins at its own zero, so two cannot be shown at once.",
    )


def _require_version(path: Path, events: Sequence[Recorded]) -> None:
    first = events[0].event
    version = first.payload.get("version") if first.kind == "session" else None
    if version != JOURNAL_VERSION:
        raise BadInputError(
            where=str(path),
            found="a session that does not declare itself first"
            if version is None
            else f"a journal of version {version}",
            expected=f"version {JOURNAL_VERSION}",
            action="Run the stage that writes it again, or replay it with the genpolicy of its "
            "time.",
        )
