"""Files that are not recordings: each is refused by name, place and remedy, never a traceback."""

import contextlib
import io
import resource
import subprocess
import sys

import numpy as np
import orjson
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from genpolicy.data.recording import container as container_module
from genpolicy.data.recording.container import MAGIC, MAXIMUM_FILE_BYTES
from genpolicy.data.recording.reader import parse_episode, read_episode
from genpolicy.data.recording.writer import EPISODE_METADATA, episode_bytes
from genpolicy.errors import BadInputError

UUID = "00000000-0000-0000-0000-000000000009"


def refused(data, match):
    with pytest.raises(BadInputError, match=match) as caught:
        parse_episode(data, where="bad.mcap")
    assert caught.value.where.startswith("bad.mcap")
    assert caught.value.exit_code == 2
    assert caught.value.action
    return caught.value


class Maker:
    """A hand-made MCAP with one mistake."""

    def __init__(self, *, metadata=True, data_crc=True, crc=True, compression=CompressionType.ZSTD):
        self.sink = io.BytesIO()
        self.writer = Writer(
            self.sink, enable_data_crcs=data_crc, enable_crcs=crc, compression=compression
        )
        self.writer.start()
        if metadata:
            self.writer.add_metadata(EPISODE_METADATA, {"episode_uuid": UUID})

    def channel(self, topic="/robot/gripper", schema="genpolicy.Gripper", encoding="jsonschema"):
        schema_id = self.writer.register_schema(schema, encoding, b"{}")
        return self.writer.register_channel(topic, "json", schema_id)

    def message(self, channel, body=None, *, time=7, log_time=8, sequence=0, raw=None):
        stamp = {"timestamp": {"sec": 0, "nsec": time}}
        data = orjson.dumps({**stamp, **(body or {})}) if raw is None else raw
        self.writer.add_message(channel, log_time, data, time, sequence)
        return self

    def bytes(self):
        self.writer.finish()
        return self.sink.getvalue()


def plain(body=None, **options):
    """A recording with one message of plain numbers, which is well formed unless told."""
    maker = Maker()
    channel = maker.channel("/stream/any", "genpolicy.Numbers")
    return maker.message(channel, {"values": [1.0]} if body is None else body, **options).bytes()


def test_the_plain_recording_itself_is_accepted():
    assert parse_episode(plain(), where="x").streams["any"].values.tolist() == [[1.0]]


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


def test_unknown_schema_and_topic():
    maker = Maker()
    maker.message(maker.channel(schema="other.Thing"), {"opening_m": 0.0})
    refused(maker.bytes(), "other.Thing")
    maker = Maker()
    maker.message(maker.channel("/camera/image"), {"opening_m": 0.0})
    refused(maker.bytes(), "/camera/image is unknown")
    maker = Maker()
    maker.message(maker.channel(encoding="protobuf"), {"opening_m": 0.0})
    refused(maker.bytes(), "jsonschema")


@pytest.mark.parametrize(
    "raw",
    [b"", b"{", b"[]", b"null", b'{"timestamp": 3}', b"\xff\xfe", b'{"a": NaN}', b"[" * 100_000],
)
def test_not_json(raw):
    refused(plain(raw=raw), "message 0")


@pytest.mark.parametrize(
    "body",
    [{}, {"values": 3.0}, {"values": ["1.0"]}, {"values": [True]}, {"values": {"0": 1.0}}],
)
def test_json_that_does_not_match(body):
    refused(plain(body or {"else": 1}), "message 0 is not a genpolicy.Numbers")


def test_json_of_another_time_frame_or_width():
    body = {"timestamp": {"sec": 0, "nsec": 8}, "values": [1.0]}
    refused(plain(raw=orjson.dumps(body)), "expected the publish time 7 ns")
    maker = Maker()
    channel = maker.channel("/robot/wrench", "genpolicy.Wrench")
    force = {"x": 0.0, "y": 0.0, "z": 0.0}
    maker.message(channel, {"frame_id": "world", "force_n": force})
    refused(maker.bytes(), "robot_base")
    maker = Maker()
    channel = maker.channel("/stream/any", "genpolicy.Numbers")
    maker.message(channel, {"values": [1.0]}, sequence=1)
    maker.message(channel, {"values": [1.0, 2.0]}, sequence=2)
    refused(maker.bytes(), "message 1")


def test_missing_topic_of_a_stream():
    maker = Maker()
    maker.message(maker.channel(), {"opening_m": 0.0})
    refused(maker.bytes(), "/robot/tcp is missing")


def test_topics_of_a_stream_that_disagree(factory, monkeypatch):
    maker = Maker()
    pose = maker.channel("/action/tcp", "foxglove.PoseInFrame")
    position, q = {"x": 0.0, "y": 0.0, "z": 0.0}, {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    body = {"frame_id": "robot_base", "pose": {"position": position, "orientation": q}}
    maker.message(pose, body)
    maker.message(maker.channel("/action/gripper"), {"opening_m": 0.0}, time=9, log_time=10)
    refused(maker.bytes(), "other times or numbers")


def test_zero_messages():
    maker = Maker()
    maker.channel()
    refused(maker.bytes(), "without messages")


def test_missing_metadata_and_uuid():
    refused(Maker(metadata=False).bytes(), "without episode metadata")
    for text in ("", "x", UUID.replace("9", "A")):
        maker = Maker(metadata=False)
        maker.writer.add_metadata(EPISODE_METADATA, {"episode_uuid": text})
        maker.message(maker.channel("/stream/any", "genpolicy.Numbers"), {"values": [1.0]})
        refused(maker.bytes(), "expected a lower-case UUID")


@pytest.mark.parametrize("log_time", [0, 2**63, 2**64 - 1])
def test_impossible_times(log_time):
    refused(plain(log_time=log_time), "message 0: log time")


def test_sequence_number_twice():
    maker = Maker()
    channel = maker.channel("/stream/any", "genpolicy.Numbers")
    maker.message(channel, {"values": [1.0]}, sequence=4)
    maker.message(channel, {"values": [1.0]}, sequence=4)
    refused(maker.bytes(), "sequence number twice")


def test_one_topic_on_two_channels_with_different_schemas():
    maker = Maker()
    maker.message(maker.channel(), {"opening_m": 0.0})
    maker.message(maker.channel(schema="genpolicy.Offset"), {"offset_m": 0.0})
    refused(maker.bytes(), "/robot/gripper is on two channels")


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


def test_paths_that_are_no_recordings(tmp_path):
    large = tmp_path / "large.mcap"
    with large.open("wb") as stream:
        stream.truncate(MAXIMUM_FILE_BYTES + 1)
    link = tmp_path / "link.mcap"
    link.symlink_to(large)
    for path in (large, link, tmp_path, tmp_path / "absent.mcap"):
        with pytest.raises(BadInputError, match=path.name):
            read_episode(path)


def test_reading_from_the_command_line_gives_one_sentence(tmp_path):
    """The error text alone names file, place and what to do."""
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(b"nonsense" * 10)
    code = (
        "import sys\nfrom pathlib import Path\nfrom genpolicy.errors import BadInputError\n"
        "from genpolicy.data.recording.reader import read_episode\n"
        "try:\n    read_episode(Path(sys.argv[1]))\n"
        "except BadInputError as error:\n    print(error); sys.exit(error.exit_code)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(bad)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stdout.count("\n") == 1
    assert "bad.mcap" in done.stdout
    assert "Record the episode again" in done.stdout


def test_mutants_with_valid_checksums_never_escape_as_another_error(monkeypatch, factory):
    """What a hostile recorder could write: 600 mutations behind checksums that fit."""
    monkeypatch.setattr(container_module, "_check_crc", lambda *_: None)
    maker = Maker(compression=CompressionType.NONE, data_crc=False, crc=False)
    pose = maker.channel("/action/tcp", "foxglove.PoseInFrame")
    grip = maker.channel("/action/gripper")
    position, q = {"x": 0.5, "y": 0.0, "z": 0.1}, {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    for n in range(3):
        body = {"frame_id": "robot_base", "pose": {"position": position, "orientation": q}}
        maker.message(pose, body, sequence=n)
        maker.message(grip, {"opening_m": 0.01}, sequence=n)
    data = maker.bytes()
    parse_episode(data, where="good")
    rng = np.random.default_rng(5)
    for _ in range(600):
        changed = bytearray(data)
        for position in rng.integers(8, len(data) - 8, rng.integers(1, 4)):
            changed[position] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.integers(256)])
        with contextlib.suppress(BadInputError):
            parse_episode(bytes(changed), where="bad.mcap")
