"""Episode to MCAP: publish time = event time, log time = receive time, sorted by log time."""

import io
from pathlib import Path

import orjson
from mcap.writer import CompressionType, Writer

from genpolicy.data.recording.episode import RecordedEpisode, StreamSamples
from genpolicy.data.recording.layout import PHASE_TOPIC, topics_of
from genpolicy.data.recording.wire import LOG_SCHEMA, LOG_SCHEMA_NAME, encode, timestamp
from genpolicy.errors import ContractError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json

PROFILE = "genpolicy"
LIBRARY = "genpolicy recording 1"
EPISODE_METADATA = "genpolicy.episode"
UUID_KEY = "episode_uuid"
CHUNK_BYTES = 512 << 10
LOG_LEVEL_INFO = 2

Outgoing = tuple[int, int, int, int, bytes]
"""log time, channel, sequence, publish time, data"""


def write_episode(path: Path, episode: RecordedEpisode) -> None:
    """Write one episode as an MCAP file, whole or not at all.

    Raises:
        ContractError: A time outside 1 … 2**63 - 1 ns, a rotation that is not one.
        BadInputError: The place cannot be written.
    """
    write_bytes(path, episode_bytes(episode))


def episode_bytes(episode: RecordedEpisode) -> bytes:
    """The bytes of the MCAP file; equal episodes give equal bytes.

    Raises:
        ContractError: A time outside 1 … 2**63 - 1 ns, a rotation that is not one.
    """
    sink = io.BytesIO()
    writer = Writer(
        sink,
        chunk_size=CHUNK_BYTES,
        compression=CompressionType.ZSTD,
        enable_crcs=True,
        enable_data_crcs=True,
    )
    writer.start(profile=PROFILE, library=LIBRARY)
    metadata = {UUID_KEY: episode.episode_uuid, **episode.metadata}
    writer.add_metadata(EPISODE_METADATA, dict(sorted(metadata.items())))
    messages: list[Outgoing] = []
    schemas: dict[str, int] = {}
    for stream in sorted(episode.streams):
        messages += _stream_messages(writer, schemas, episode.streams[stream])
    messages += _phase_messages(writer, episode)
    for log_time, channel_id, sequence, publish_time, data in sorted(
        messages, key=lambda message: message[:3]
    ):
        writer.add_message(channel_id, log_time, data, publish_time, sequence)
    writer.finish()  # type: ignore[no-untyped-call]
    return sink.getvalue()


def _stream_messages(
    writer: Writer, schemas: dict[str, int], samples: StreamSamples
) -> list[Outgoing]:
    where = f"stream {samples.stream}"
    event_times, receive_times = samples.event_time_ns.tolist(), samples.receive_time_ns.tolist()
    _check_times(where, event_times + receive_times)
    messages: list[Outgoing] = []
    start = 0
    for topic in topics_of(samples.stream, samples.values.shape[1]):
        kind = topic.kind
        if kind.schema_name not in schemas:
            schemas[kind.schema_name] = writer.register_schema(
                kind.schema_name, "jsonschema", canonical_json(kind.schema)
            )
        channel_id = writer.register_channel(topic.name, "json", schemas[kind.schema_name])
        width = kind.width or samples.values.shape[1]
        part = samples.values[:, start : start + width]
        start += width
        encoded = encode(kind, part, event_times, where=where)
        messages += [
            (receive, channel_id, sequence, event, data)
            for sequence, (receive, event, data) in enumerate(
                zip(receive_times, event_times, encoded, strict=True)
            )
        ]
    return messages


def _phase_messages(writer: Writer, episode: RecordedEpisode) -> list[Outgoing]:
    schema_id = writer.register_schema(LOG_SCHEMA_NAME, "jsonschema", canonical_json(LOG_SCHEMA))
    channel_id = writer.register_channel(PHASE_TOPIC, "json", schema_id)
    messages: list[Outgoing] = []
    for sequence, (event, receive, phase) in enumerate(episode.phase_events):
        _check_times(f"phase event {sequence}", [int(event), int(receive)])
        document = {
            "timestamp": timestamp(event),
            "level": LOG_LEVEL_INFO,
            "message": phase,
            "name": "phase",
            "file": "",
            "line": 0,
        }
        messages.append((int(receive), channel_id, sequence, int(event), orjson.dumps(document)))
    return messages


def _check_times(where: str, times_ns: list[int]) -> None:
    for time_ns in times_ns:
        if not 0 < time_ns < 1 << 63:
            raise ContractError(
                where=f"{where}: time",
                found=f"{time_ns} ns",
                expected="1 to 2**63 - 1 ns",
                action="Record with a running clock; 0 means that a time was never set.",
            )
