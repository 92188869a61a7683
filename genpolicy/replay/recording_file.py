"""A recording as public viewers read it: its messages byte for byte, its schemas in plain types.

Recordings are written with numbers that may be `null`, which JSON Schema can say and the viewers'
readers cannot: they stop at a channel whose schema has a list of types. The copy calls them
numbers; a sample that was not recorded still is `null` in its message. What has another schema
than the recording's own layout is copied as it is.
"""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from genpolicy.data.recording.container import Channel, Container, Schema, parse_container
from genpolicy.data.recording.layout import stream_of
from genpolicy.data.recording.writer import CHUNK_BYTES, LIBRARY, PROFILE
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes_of


def write_viewable(recording: Path, out: Path) -> dict[str, int]:
    """Write a recording with schemas that viewers read; the recording is only read.

    Args:
        recording: An MCAP recording.
        out: The MCAP file to write, whole or not at all.

    Returns:
        Messages of each topic.

    Raises:
        IntegrityError: No regular file, truncated, changed, without checksums, or not MCAP.
        ContractError: Two records contradict each other.
        BadInputError: A size cap is broken, or the place cannot be written.
    """
    _, data = sha256_bytes_of(recording, keep=True)
    found = parse_container(data, where=str(recording))
    write_bytes(out, _viewable(found))
    return {
        channel.topic: len(found.messages[number])
        for number, channel in sorted(found.channels.items(), key=lambda item: item[1].topic)
    }


def _viewable(found: Container) -> bytes:
    """The bytes of the copy, in the order of log time; equal recordings give equal bytes."""
    sink = io.BytesIO()
    writer = Writer(
        sink, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True
    )
    writer.start(profile=PROFILE, library=LIBRARY)
    for name, metadata in sorted(found.metadata.items()):
        writer.add_metadata(name, metadata)
    numbers = {
        number: _register(writer, channel, found.schemas.get(channel.schema_id))
        for number, channel in sorted(found.channels.items())
    }
    messages = [
        (one.log_time, number, one.sequence, one)
        for number, own in found.messages.items()
        for one in own
    ]
    for log_time, number, sequence, message in sorted(messages, key=lambda item: item[:3]):
        writer.add_message(numbers[number], log_time, message.data, message.publish_time, sequence)
    writer.finish()  # type: ignore[no-untyped-call]
    return sink.getvalue()


def _register(writer: Writer, channel: Channel, schema: Schema | None) -> int:
    topic, number = channel.topic, 0
    known = stream_of(topic)
    own = next((item.kind for item in known[1] if item.name == topic), None) if known else None
    # A stream of another maker may go by the same topic: its schema is its own.
    if own is not None and schema is not None and schema.name == own.schema_name:
        data = canonical_json(plain(own.schema))
        number = writer.register_schema(own.schema_name, "jsonschema", data)
    elif schema is not None:
        number = writer.register_schema(schema.name, schema.encoding, schema.data)
    return writer.register_channel(topic, channel.message_encoding, number)


def plain(schema: Mapping[str, Any]) -> dict[str, Any]:
    """A schema whose numbers that may be `null` are numbers, all else as it was."""
    found: dict[str, Any] = {}
    for key, value in schema.items():
        if key == "type" and isinstance(value, list):
            [found[key]] = [name for name in value if name != "null"]
        elif isinstance(value, Mapping):
            found[key] = plain(value)
        else:
            found[key] = value
    return found
