"""The MCAP container: bytes to schemas, channels, messages and metadata, with every check on.

The recording is read from front to back, so that nothing depends on an index, and every byte is
covered by a checksum that must be present: the data section by its own, the summary and footer
by theirs. Sizes are checked before anything is decompressed or allocated.

Source: MCAP specification, version 0 (mcap.dev/spec).
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NoReturn

import zstandard
from mcap.opcode import Opcode

from genpolicy.errors import BadInputError, ContractError, IntegrityError

MAGIC = b"\x89MCAP0\r\n"
MAXIMUM_FILE_BYTES = 64 << 20
MAXIMUM_RECORD_BYTES = 64 << 20
MAXIMUM_UNCOMPRESSED_BYTES = 128 << 20
MAXIMUM_MESSAGES = 1_000_000
FOOTER_BYTES = 20
ACTION = "Record the episode again, or restore the original file."

_RECORD_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")


@dataclass(frozen=True)
class Schema:
    """A schema record."""

    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class Channel:
    """A channel record: one topic."""

    topic: str
    message_encoding: str
    schema_id: int


@dataclass(frozen=True)
class Message:
    """A message record; times in ns."""

    sequence: int
    log_time: int
    publish_time: int
    data: bytes


@dataclass
class Container:
    """What one MCAP file holds; messages by channel in file order."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: dict[int, list[Message]] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    message_count: int = 0
    uncompressed_bytes: int = 0


def parse_container(data: bytes, *, where: str) -> Container:
    """The content of the bytes of one MCAP file.

    Raises:
        IntegrityError: Truncated, changed, without checksums, or not MCAP.
        ContractError: A size cap is broken, or two records contradict each other.
    """
    try:
        return _parse(data, where)
    except (struct.error, UnicodeDecodeError, zstandard.ZstdError, MemoryError) as error:
        raise IntegrityError(
            where=where,
            found=f"malformed ({error})",
            expected="whole MCAP records",
            action=ACTION,
        ) from error


def _parse(data: bytes, where: str) -> Container:
    _check_ends(data, where)
    container = Container()
    data_end: int | None = None
    for opcode, start, length in _records(data, len(MAGIC), len(data) - len(MAGIC), where):
        head = start - _RECORD_HEAD.size
        if head == len(MAGIC) and opcode != Opcode.HEADER:
            _malformed(f"{where}: byte {head}", f"a record {opcode:#04x}", "the header record")
        if opcode == Opcode.DATA_END:
            data_end = start + length
            (found,) = struct.unpack_from("<I", data, start)
            _check_crc(f"{where}: data section", found, zlib.crc32(data[:head]))
        elif opcode == Opcode.FOOTER:
            _check_footer(data, data_end, start, length, where)
            return container
        elif data_end is None:
            _read_record(container, opcode, data[start : start + length], f"{where}: byte {head}")
    _malformed(where, "without a footer", "a finished recording")


def _check_ends(data: bytes, where: str) -> None:
    if not data:
        _malformed(where, "empty", "a finished MCAP recording")
    if len(data) > MAXIMUM_FILE_BYTES:
        _too_large(where, f"{len(data)} bytes", f"at most {MAXIMUM_FILE_BYTES} bytes")
    if not data.startswith(MAGIC):
        _malformed(where, "a file that does not begin as MCAP", "the MCAP magic bytes")
    if len(data) < 2 * len(MAGIC) or not data.endswith(MAGIC):
        _malformed(where, "cut off or still being written", "the closing MCAP magic bytes")


def _records(data: bytes, start: int, end: int, where: str) -> Iterator[tuple[int, int, int]]:
    """Opcode, start of the content and its length, of every record in data[start:end]."""
    while start < end:
        if end - start < _RECORD_HEAD.size:
            _malformed(f"{where}: byte {start}", "cut off", "a whole record")
        opcode, length = _RECORD_HEAD.unpack_from(data, start)
        start += _RECORD_HEAD.size
        if length > MAXIMUM_RECORD_BYTES:
            _too_large(
                f"{where}: byte {start}",
                f"a record that claims {length} bytes",
                f"at most {MAXIMUM_RECORD_BYTES}",
            )
        if length > end - start:
            _malformed(f"{where}: byte {start}", "cut off", f"{length} bytes of record")
        yield opcode, start, length
        start += length


def _check_footer(data: bytes, data_end: int | None, start: int, length: int, where: str) -> None:
    if data_end is None:
        _malformed(where, "without an end of its data section", "a finished recording")
    if length != FOOTER_BYTES or start + length != len(data) - len(MAGIC):
        _malformed(f"{where}: footer", "misplaced", "the last record of the file")
    (found,) = struct.unpack_from("<I", data, start + FOOTER_BYTES - 4)
    covered = data[data_end : start + FOOTER_BYTES - 4]
    _check_crc(f"{where}: summary section", found, zlib.crc32(covered))


def _check_crc(where: str, found: int, computed: int) -> None:
    if found == 0:
        _malformed(where, "without a checksum", "a CRC-32 over the whole section")
    if found != computed:
        _malformed(where, f"changed (CRC {computed:08x})", f"CRC {found:08x}")


def _read_record(container: Container, opcode: int, data: bytes, where: str) -> None:
    if opcode == Opcode.CHUNK:
        _read_chunk(container, data, where)
    elif opcode == Opcode.METADATA:
        name, offset = _string(data, 0)
        if name in container.metadata:
            _contradicts(where, f"a second metadata record {name!r}", "one of each name")
        container.metadata[name] = _string_map(data, offset)
    else:
        _read_content(container, opcode, data, where)


def _read_content(container: Container, opcode: int, data: bytes, where: str) -> None:
    """A record that may stand inside a chunk; every other kind carries nothing that is used."""
    if opcode == Opcode.MESSAGE:
        channel_id, sequence, log_time, publish_time = _MESSAGE_HEAD.unpack_from(data, 0)
        if channel_id not in container.channels:
            _contradicts(where, f"a message of the unknown channel {channel_id}", "a known channel")
        container.message_count += 1
        if container.message_count > MAXIMUM_MESSAGES:
            _too_large(where, "one message more", f"at most {MAXIMUM_MESSAGES} messages")
        message = Message(sequence, log_time, publish_time, data[_MESSAGE_HEAD.size :])
        container.messages[channel_id].append(message)
    elif opcode == Opcode.SCHEMA:
        (schema_id,) = struct.unpack_from("<H", data, 0)
        name, offset = _string(data, 2)
        encoding, offset = _string(data, offset)
        (length,) = struct.unpack_from("<I", data, offset)
        schema = Schema(name, encoding, data[offset + 4 : offset + 4 + length])
        if container.schemas.setdefault(schema_id, schema) != schema:
            _contradicts(where, f"schema {schema_id} a second time, different", "one definition")
    elif opcode == Opcode.CHANNEL:
        channel_id, schema_id = struct.unpack_from("<HH", data, 0)
        topic, offset = _string(data, 4)
        encoding, _ = _string(data, offset)
        channel = Channel(topic, encoding, schema_id)
        if container.channels.setdefault(channel_id, channel) != channel:
            _contradicts(where, f"channel {channel_id} a second time, different", "one definition")
        container.messages.setdefault(channel_id, [])


def _read_chunk(container: Container, data: bytes, where: str) -> None:
    _, _, size, crc = _CHUNK_HEAD.unpack_from(data, 0)
    compression, offset = _string(data, _CHUNK_HEAD.size)
    (stored,) = struct.unpack_from("<Q", data, offset)
    body = data[offset + 8 :]
    container.uncompressed_bytes += size
    if stored != len(body):
        _malformed(where, f"a chunk of {len(body)} bytes", f"{stored} bytes")
    if size > MAXIMUM_RECORD_BYTES or container.uncompressed_bytes > MAXIMUM_UNCOMPRESSED_BYTES:
        _too_large(
            where,
            f"a chunk that grows to {size} bytes",
            f"at most {MAXIMUM_RECORD_BYTES}, and {MAXIMUM_UNCOMPRESSED_BYTES} in all chunks",
        )
    content = _decompress(body, compression, size, where)
    if len(content) != size or (crc != 0 and zlib.crc32(content) != crc):
        _malformed(where, "a chunk whose content changed", f"CRC {crc:08x} and {size} bytes")
    for opcode, start, length in _records(content, 0, len(content), where):
        inner = f"{where}, chunk byte {start}"
        _read_content(container, opcode, content[start : start + length], inner)


def _decompress(body: bytes, compression: str, size: int, where: str) -> bytes:
    if compression == "":
        return body
    if compression != "zstd":
        _contradicts(where, f"compressed with {compression[:20]!r}", "zstd or none")
    declared = zstandard.frame_content_size(body)
    if declared != size:
        _malformed(where, f"a zstd frame of {declared} bytes", f"{size} bytes")
    return zstandard.ZstdDecompressor().decompress(body, max_output_size=size)


def _string(data: bytes, offset: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", data, offset)
    end = offset + 4 + length
    if end > len(data):
        raise struct.error(f"string of {length} bytes at byte {offset} leaves its record")
    return data[offset + 4 : end].decode(), end


def _string_map(data: bytes, offset: int) -> dict[str, str]:
    (length,) = struct.unpack_from("<I", data, offset)
    offset += 4
    end = offset + length
    result: dict[str, str] = {}
    while offset < end:
        key, offset = _string(data, offset)
        value, offset = _string(data, offset)
        if key in result:
            raise struct.error(f"metadata key {key!r} twice")
        result[key] = value
    return result


def _malformed(where: str, found: str, expected: str) -> NoReturn:
    raise IntegrityError(where=where, found=found, expected=expected, action=ACTION)


def _too_large(where: str, found: str, expected: str) -> NoReturn:
    raise BadInputError(
        where=where, found=found, expected=expected, action="Split the recording by episode."
    )


def _contradicts(where: str, found: str, expected: str) -> NoReturn:
    raise ContractError(where=where, found=found, expected=expected, action=ACTION)
