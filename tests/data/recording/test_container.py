"""The container of a recording: cut off, flipped, bombed, each refused by place."""

import contextlib
import resource

import numpy as np
import zstandard
from making import UUID, Maker, refused
from mcap.opcode import Opcode
from mcap.writer import CompressionType

from genpolicy.data.recording import container as container_module
from genpolicy.data.recording.container import MAGIC
from genpolicy.data.recording.reader import parse_episode
from genpolicy.data.recording.writer import EPISODE_METADATA, episode_bytes
from genpolicy.errors import BadInputError


def test_empty():
    refused(b"", "empty")


def test_random_bytes(factory):
    rng = np.random.default_rng(0)
    for size in (1, 7, 8, 16, 17, 100, 5000):
        refused(rng.bytes(size), "MCAP")
        refused(MAGIC + rng.bytes(size) + MAGIC, "bad.mcap")


def test_truncated_everywhere(factory):
    data = episode_bytes(factory.episode(0, steps=2))
    ends = {*np.linspace(0, len(data) - 1, 60).astype(int).tolist(), len(data) - 8, 8, 9}
    for end in ends:
        refused(data[:end], "bad.mcap")
        if end != len(data) - len(MAGIC):
            refused(data[:end] + MAGIC, "bad.mcap")


def test_no_footer(factory):
    data = episode_bytes(factory.episode(0, steps=2))
    refused(data[: -len(MAGIC) - 29] + MAGIC, "without a footer")


def test_bit_flips_200_of_200_are_refused(factory):
    data = episode_bytes(factory.episode(0, steps=2))
    rng = np.random.default_rng(1)
    silent = 0
    for position in rng.choice(8 * len(data), 200, replace=False):
        changed = bytearray(data)
        changed[position // 8] ^= 1 << (position % 8)
        with contextlib.suppress(BadInputError):
            parse_episode(bytes(changed), where="bad.mcap")
            silent += 1
    assert silent == 0


def test_every_bit_of_the_ends_matters(factory):
    data = episode_bytes(factory.episode(0, steps=2))
    for position in [*range(0, 8 * 60), *range(8 * (len(data) - 60), 8 * len(data))]:
        changed = bytearray(data)
        changed[position // 8] ^= 1 << (position % 8)
        refused(bytes(changed), "bad.mcap")


def test_without_checksums():
    maker = Maker(data_crc=False)
    maker.message(maker.channel("/stream/any", "genpolicy.Numbers"), {"values": [1.0]})
    refused(maker.bytes(), "data section is without a checksum")


def test_missing_metadata_and_uuid():
    refused(Maker(metadata=False).bytes(), "without episode metadata")
    for text in ("", "x", UUID.replace("9", "A")):
        maker = Maker(metadata=False)
        maker.writer.add_metadata(EPISODE_METADATA, {"episode_uuid": text})
        maker.message(maker.channel("/stream/any", "genpolicy.Numbers"), {"values": [1.0]})
        refused(maker.bytes(), "expected a lower-case UUID")


def test_two_metadata_records():
    maker = Maker()
    maker.writer.add_metadata(EPISODE_METADATA, {"episode_uuid": UUID})
    refused(maker.bytes(), "a second metadata record")


def test_lz4_is_refused():
    maker = Maker(compression=CompressionType.LZ4)
    maker.message(maker.channel("/stream/any", "genpolicy.Numbers"), {"values": [1.0]})
    refused(maker.bytes(), "zstd or none")


def test_uncompressed_is_accepted():
    maker = Maker(compression=CompressionType.NONE)
    maker.message(maker.channel("/stream/any", "genpolicy.Numbers"), {"values": [1.0]})
    assert parse_episode(maker.bytes(), where="x").streams["any"].values.tolist() == [[1.0]]


def test_attachment_with_a_climbing_name_touches_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    maker = Maker()
    maker.writer.add_attachment(1, 1, "../../x", "text/plain", b"x")
    maker.message(maker.channel("/stream/any", "genpolicy.Numbers"), {"values": [1.0]})
    parse_episode(maker.bytes(), where="x")
    assert not list(tmp_path.iterdir())


def chunk_file(size, body):
    """A file whose only chunk claims `size` bytes."""
    import struct
    import zlib

    def record(opcode, data):
        return struct.pack("<BQ", opcode, len(data)) + data

    head = record(Opcode.HEADER, struct.pack("<II", 0, 0))
    chunk = struct.pack("<QQQI", 0, 0, size, 0) + struct.pack("<I", 4) + b"zstd"
    data = MAGIC + head + record(Opcode.CHUNK, chunk + struct.pack("<Q", len(body)) + body)
    end = record(Opcode.DATA_END, struct.pack("<I", zlib.crc32(data)))
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, 0, 0)
    return data + end + footer + struct.pack("<I", zlib.crc32(footer)) + MAGIC


def test_bomb_is_refused_before_it_is_unpacked():
    bomb = zstandard.compress(bytes(200 << 20))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    refused(chunk_file(200 << 20, bomb), "grows to")
    refused(chunk_file(1000, bomb), "zstd frame of")
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert (after - before) < 100 << 10


def test_record_of_impossible_length():
    import struct

    refused(MAGIC + struct.pack("<BQ", 1, 2**63) + bytes(20) + MAGIC, "a record that claims")


def test_too_many_messages(monkeypatch, factory):
    monkeypatch.setattr(container_module, "MAXIMUM_MESSAGES", 10)
    refused(episode_bytes(factory.episode(0, steps=2)), "at most 10 messages")
