"""MCAP to episode: checked container, known topics, known schemas, matching messages."""

import os
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn
from uuid import UUID

import numpy as np

from genpolicy.data.recording.container import (
    MAXIMUM_FILE_BYTES,
    Channel,
    Container,
    Message,
    parse_container,
)
from genpolicy.data.recording.episode import PHASE_STREAM, RecordedEpisode, StreamSamples
from genpolicy.data.recording.layout import PHASE_TOPIC, Topic, stream_of
from genpolicy.data.recording.wire import LOG_SCHEMA_NAME, decode, parse
from genpolicy.data.recording.writer import EPISODE_METADATA, UUID_KEY
from genpolicy.errors import BadInputError, ContractError
from genpolicy.integrity.hashing import sha256_bytes_of


def read_episode(path: Path) -> RecordedEpisode:
    """The episode in an MCAP file.

    Raises:
        BadInputError: Missing, larger than the cap, truncated, changed, without checksums, or
            not made of the topics, schemas and metadata of a recording; names the place.
    """
    return read_hashed_episode(path)[0]


def read_hashed_episode(path: Path, *, where: str | None = None) -> tuple[RecordedEpisode, str]:
    """The episode in an MCAP file and the SHA-256 of the very bytes that were parsed.

    Args:
        path: The file.
        where: What error texts call it; the path if absent.

    Raises:
        BadInputError: As for `read_episode`.
    """
    name = where or os.fspath(path)
    _check_file(path, name)
    digest, data = sha256_bytes_of(path, keep=True)
    return parse_episode(data, where=name), digest


def parse_episode(data: bytes, *, where: str) -> RecordedEpisode:
    """The episode in the bytes of an MCAP file.

    Raises:
        BadInputError: As for `read_episode`.
    """
    container = parse_container(data, where=where)
    metadata = _metadata(container, where)
    if container.message_count == 0:
        _refuse(where, "without messages", "a recorded episode")
    topics = _topics(container, where)
    episode_uuid = metadata.pop(UUID_KEY)
    streams: dict[str, StreamSamples] = {}
    phase_events: tuple[tuple[int, int, str], ...] = ()
    for topic in topics:
        if topic == PHASE_TOPIC:
            phase_events = _phase_events(topics, where)
            continue
        found = stream_of(topic)
        if found is None:
            _refuse(f"{where}: topic {topic}", "unknown", "a topic of the recording layout")
        stream, parts = found
        if topic == parts[0].name and stream in streams:
            _refuse(f"{where}: stream {stream}", "recorded twice", "one set of topics")
        if stream not in streams:
            streams[stream] = _samples(topics, stream, parts, where)
    return RecordedEpisode(episode_uuid, streams, phase_events, metadata)


def _check_file(path: Path, where: str) -> None:
    try:
        status = path.lstat()
    except (OSError, ValueError) as error:
        raise BadInputError(
            where=where,
            found=f"not readable ({getattr(error, 'strerror', None) or error})",
            expected="an MCAP recording",
            action="Check the path.",
        ) from error
    if stat.S_ISREG(status.st_mode) and status.st_size > MAXIMUM_FILE_BYTES:
        raise BadInputError(
            where=where,
            found=f"{status.st_size} bytes",
            expected=f"at most {MAXIMUM_FILE_BYTES}",
            action="Split the recording by episode.",
        )


def _metadata(container: Container, where: str) -> dict[str, str]:
    if EPISODE_METADATA not in container.metadata:
        _refuse(where, "without episode metadata", f"a metadata record {EPISODE_METADATA}")
    metadata = dict(container.metadata[EPISODE_METADATA])
    found = metadata.get(UUID_KEY, "")
    try:
        valid = str(UUID(found)) == found
    except ValueError:
        valid = False
    if not valid:
        _refuse(f"{where}: {UUID_KEY}", repr(found)[:60], "a lower-case UUID")
    return metadata


def _topics(container: Container, where: str) -> dict[str, list[Message]]:
    """Messages by topic; every channel must have a known topic, schema and encoding."""
    topics: dict[str, list[Message]] = {}
    for channel_id, channel in container.channels.items():
        place = f"{where}: topic {channel.topic[:80]}"
        if channel.topic in topics:
            _refuse(place, "on two channels", "one channel, with one schema")
        _check_schema(container, channel, place)
        topics[channel.topic] = container.messages[channel_id]
    return topics


def _check_schema(container: Container, channel: Channel, place: str) -> None:
    known = stream_of(channel.topic)
    if channel.topic == PHASE_TOPIC:
        expected = LOG_SCHEMA_NAME
    elif known is not None:
        expected = next(part for part in known[1] if part.name == channel.topic).kind.schema_name
    else:
        _refuse(place, "unknown", "a topic of the recording layout")
    schema = container.schemas.get(channel.schema_id)
    if schema is None or schema.name != expected or schema.encoding != "jsonschema":
        found = "no schema" if schema is None else f"schema {schema.name[:60]!r}"
        _refuse(place, f"of {found}", f"schema {expected!r} in jsonschema")
    if channel.message_encoding != "json":
        _refuse(place, f"encoded as {channel.message_encoding[:20]!r}", "json")


def _samples(
    topics: dict[str, list[Message]], stream: str, parts: Sequence[Topic], where: str
) -> StreamSamples:
    place = f"{where}: stream {stream}"
    values = []
    first: list[Message] = []
    for part in parts:
        if not topics.get(part.name):
            _refuse(f"{where}: topic {part.name}", "missing or empty", f"recorded with {stream}")
        messages = _ordered(topics[part.name], f"{where}: topic {part.name}")
        first = first or messages
        if [_stamp(message) for message in messages] != [_stamp(message) for message in first]:
            _refuse(
                f"{where}: topic {part.name}",
                f"{len(messages)} messages with other times or numbers",
                f"the times and sequence numbers of {parts[0].name} ({len(first)} messages)",
            )
        events = [message.publish_time for message in messages]
        data = [message.data for message in messages]
        values.append(decode(part.kind, data, events, where=f"{where}: topic {part.name}"))
    try:
        return StreamSamples(
            stream=stream,
            event_time_ns=np.array([message.publish_time for message in first], dtype=np.int64),
            receive_time_ns=np.array([message.log_time for message in first], dtype=np.int64),
            values=np.concatenate(values, axis=1),
        )
    except ValueError as error:
        raise ContractError(
            where=place, found=str(error), expected="rows of one width", action="Record it again."
        ) from error


def _phase_events(topics: dict[str, list[Message]], where: str) -> tuple[tuple[int, int, str], ...]:
    place = f"{where}: {PHASE_STREAM}"
    events = []
    for index, message in enumerate(_ordered(topics[PHASE_TOPIC], place)):
        document = parse(message.data, message.publish_time, where=f"{place}, message {index}")
        phase = document.get("message")
        if not isinstance(phase, str) or not phase:
            _refuse(f"{place}, message {index}", f"a log of {phase!r:.60}", "the name of a phase")
        events.append((message.publish_time, message.log_time, phase))
    return tuple(events)


def _ordered(messages: list[Message], where: str) -> list[Message]:
    """Messages in the order of the sender: by sequence number, or as logged if it sends none."""
    for index, message in enumerate(messages):
        for name, time_ns in (("log", message.log_time), ("publish", message.publish_time)):
            if not 0 < time_ns < 1 << 63:
                _refuse(
                    f"{where}, message {index}: {name} time", f"{time_ns} ns", "1 to 2**63 - 1 ns"
                )
    numbers = [message.sequence for message in messages]
    if not any(numbers):
        return messages
    if len(set(numbers)) != len(numbers):
        _refuse(where, "with a sequence number twice", "each message once")
    return sorted(messages, key=lambda message: message.sequence)


def _stamp(message: Message) -> tuple[int, int, int]:
    return message.sequence, message.publish_time, message.log_time


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise ContractError(
        where=where,
        found=found,
        expected=expected,
        action="Correct the recorder, or leave this recording out.",
    )
