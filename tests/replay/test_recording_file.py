"""A recording for viewers: each message to the byte, each schema one that they read."""

import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from genpolicy.data.recording.container import parse_container
from genpolicy.data.recording.reader import read_episode
from genpolicy.data.recording.wire import NUMBERS, POSE
from genpolicy.data.recording.writer import write_episode
from genpolicy.errors import GenpolicyError
from genpolicy.replay.recording_file import plain, write_viewable

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "data"))
import factory
from viewer_rules import stops_at, unread


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("recordings") / "e.mcap"
    write_episode(path, factory.episode(3, joints=True))
    return path


def parsed(path):
    return parse_container(path.read_bytes(), where="x")


def test_the_recording_itself_stops_a_viewer_and_the_copy_does_not(recording, tmp_path):
    stops, read = unread(recording.read_bytes())
    assert len(stops) >= 6 and all("['number', 'null']" in why[0] for why in stops.values())
    topics = write_viewable(recording, tmp_path / "v.mcap")
    assert unread((tmp_path / "v.mcap").read_bytes()) == ({}, len(stops) + read)
    assert sorted(topics) == list(topics) and len(topics) == len(stops) + read


def test_messages_metadata_and_times_are_those_of_the_recording(recording, tmp_path):
    before = recording.read_bytes()
    write_viewable(recording, tmp_path / "v.mcap")
    first, second = parsed(recording), parsed(tmp_path / "v.mcap")
    topics = [{c.topic: found.messages[n] for n, c in found.channels.items()}
              for found in (first, second)]  # fmt: skip
    assert topics[0] == topics[1] and first.metadata == second.metadata
    assert recording.read_bytes() == before


def test_another_makers_stream_on_a_known_topic_keeps_its_own_schema(tmp_path):
    """Injected fault: the same topic, other bytes; a schema of ours would lie about them."""
    with (tmp_path / "e.mcap").open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
        writer.start()
        schema = writer.register_schema("theirs.Joints", "protobuf", b"theirs")
        channel = writer.register_channel("/robot/joints", "protobuf", schema)
        writer.add_message(channel, 1, b"\x01", 1)
        writer.finish()
    write_viewable(tmp_path / "e.mcap", tmp_path / "v.mcap")
    [schema] = parsed(tmp_path / "v.mcap").schemas.values()
    assert (schema.name, schema.encoding, schema.data) == ("theirs.Joints", "protobuf", b"theirs")


def test_the_copy_is_a_recording_still(recording, tmp_path):
    """Property: what reads recordings reads the same episode from the copy."""
    write_viewable(recording, tmp_path / "v.mcap")
    first, second = read_episode(recording), read_episode(tmp_path / "v.mcap")
    for name, stream in first.streams.items():
        np.testing.assert_array_equal(stream.values, second.streams[name].values)
    assert first.phase_events == second.phase_events and first.metadata == second.metadata


def test_the_same_recording_gives_the_same_bytes(recording, tmp_path):
    for name in ("1", "2"):
        write_viewable(recording, tmp_path / name)
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()


def test_what_is_damaged_is_refused_and_nothing_is_written(recording, tmp_path):
    whole = bytearray(recording.read_bytes())
    whole[len(whole) // 2] ^= 1
    for number, data in enumerate((b"", bytes(whole), recording.read_bytes()[:-30])):
        (tmp_path / f"{number}.mcap").write_bytes(data)
        with pytest.raises(GenpolicyError):
            write_viewable(tmp_path / f"{number}.mcap", tmp_path / "v.mcap")
    assert not (tmp_path / "v.mcap").exists()


@pytest.mark.parametrize("kind", [POSE, NUMBERS])
def test_numbers_that_may_be_missing_are_numbers_and_nothing_else_changes(kind):
    assert stops_at(kind.schema) != [] and stops_at(plain(kind.schema)) == []
    assert str(plain(kind.schema)) == str(kind.schema).replace("['number', 'null']", "'number'")
