"""What the writer writes: golden bytes, small chunks, and what it refuses."""

import io

import numpy as np
import pytest
from mcap.reader import make_reader

from genpolicy.data.recording.episode import RecordedEpisode, StreamSamples
from genpolicy.data.recording.writer import episode_bytes
from genpolicy.errors import ContractError
from genpolicy.integrity.hashing import sha256_bytes

# Origin: sha256 of `episode_bytes(tiny_episode())`, computed once with mcap 1.6.0, zstandard
# 0.25.0 and orjson 3.13.0. Another compressor may give other bytes for the same messages.
GOLDEN_SHA256 = "38b2af6044d0ed9c505e4d7de621ccf2a025a1e8f0dd17cf48c58f5d12c4d884"


def tiny_episode():
    """Two samples per stream, exact numbers only."""
    times = np.array([10, 20], dtype=np.int64)
    pose = [0.5, 0.0, 0.25, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.04]
    rows = {"robot": pose, "force": [0.0, 0.5, -1.0], "action": pose}
    streams = {
        name: StreamSamples(name, times, times + 5, np.array([row, row]))
        for name, row in rows.items()
    }
    return RecordedEpisode(
        "00000000-0000-0000-0000-000000000001", streams, ((10, 15, "approach"),), {"task": "t"}
    )


def test_same_episode_same_bytes_other_episode_other_bytes(factory):
    assert episode_bytes(factory.episode(1)) == episode_bytes(factory.episode(1))
    assert episode_bytes(factory.episode(1)) != episode_bytes(factory.episode(2))


def test_golden_bytes():
    assert sha256_bytes(episode_bytes(tiny_episode())) == GOLDEN_SHA256


def test_the_library_reads_the_same_messages_with_foxglove_schemas(factory):
    written = factory.episode(0)
    reader = make_reader(io.BytesIO(episode_bytes(written)), validate_crcs=True)
    messages = list(reader.iter_messages(log_time_order=False))
    schemas = {channel.topic: schema.name for schema, channel, _ in messages}
    assert schemas["/robot/tcp"] == schemas["/camera/target"] == "foxglove.PoseInFrame"
    assert schemas["/action/tcp"] == "foxglove.PoseInFrame"
    assert schemas["/phase"] == "foxglove.Log"
    log_times = [message.log_time for _, _, message in messages]
    assert log_times == sorted(log_times)
    robot = [m for _, channel, m in messages if channel.topic == "/robot/tcp"]
    samples = written.streams["robot"]
    assert [m.publish_time for m in robot] == samples.event_time_ns.tolist()
    assert [m.log_time for m in robot] == samples.receive_time_ns.tolist()


def test_chunks_stay_below_one_megabyte(factory):
    written = factory.episode(0, steps=600)
    summary = make_reader(io.BytesIO(episode_bytes(written))).get_summary()
    sizes = [index.uncompressed_size for index in summary.chunk_indexes]
    assert len(sizes) > 1
    assert max(sizes) <= 1 << 20


@pytest.mark.parametrize("time_ns", [0, -1])
def test_writer_refuses_a_time_that_was_never_set(factory, time_ns):
    written = factory.episode(0)
    times = written.streams["force"].event_time_ns.copy()
    times[3] = time_ns
    with pytest.raises(ContractError, match=r"stream force: time is .* expected 1 to 2\*\*63"):
        episode_bytes(factory.with_stream(written, "force", event_time_ns=times))


def test_writer_refuses_columns_that_are_no_rotation(factory):
    written = factory.episode(0)
    values = written.streams["action"].values.copy()
    values[2, 3:9] *= 1.1
    with pytest.raises(ContractError, match="row 2: rotation"):
        episode_bytes(factory.with_stream(written, "action", values=values))
