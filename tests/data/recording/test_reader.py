"""Topics that are missing, doubled or disagree, and paths that are no recordings."""

import contextlib
import subprocess
import sys

import numpy as np
import pytest
from making import Maker, refused
from mcap.writer import CompressionType

from genpolicy.data.recording import container as container_module
from genpolicy.data.recording.container import MAXIMUM_FILE_BYTES
from genpolicy.data.recording.reader import parse_episode, read_episode
from genpolicy.errors import BadInputError


def plain(body=None, **options):
    """A recording with one message of plain numbers, which is well formed unless told."""
    maker = Maker()
    channel = maker.channel("/stream/any", "genpolicy.Numbers")
    return maker.message(channel, {"values": [1.0]} if body is None else body, **options).bytes()


def test_the_plain_recording_itself_is_accepted():
    assert parse_episode(plain(), where="x").streams["any"].values.tolist() == [[1.0]]


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
