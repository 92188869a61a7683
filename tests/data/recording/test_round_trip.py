"""Write, read, compare: a property, a golden file hash, and the library's reader as a witness."""

import io
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from scipy.spatial.transform import Rotation

from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.data.recording.episode import RecordedEpisode, StreamSamples
from genpolicy.data.recording.layout import LAYOUT
from genpolicy.data.recording.reader import parse_episode, read_episode
from genpolicy.data.recording.writer import episode_bytes, write_episode
from genpolicy.errors import ContractError
from genpolicy.integrity.hashing import sha256_bytes

TOLERANCE = 1e-12

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


def assert_same(read, written):
    assert read.episode_uuid == written.episode_uuid
    assert read.metadata == written.metadata
    assert read.phase_events == written.phase_events
    assert set(read.streams) == set(written.streams)
    for name, samples in written.streams.items():
        found = read.streams[name]
        np.testing.assert_array_equal(found.event_time_ns, samples.event_time_ns)
        np.testing.assert_array_equal(found.receive_time_ns, samples.receive_time_ns)
        np.testing.assert_allclose(found.values, samples.values, rtol=0, atol=TOLERANCE)


def test_factory_episode_round_trips(factory, tmp_path):
    written = factory.episode(3, joints=True)
    write_episode(tmp_path / "e.mcap", written)
    assert_same(read_episode(tmp_path / "e.mcap"), written)


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


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_any_rotation_yaw_and_number_round_trips(seed, count):
    rng = np.random.default_rng(seed)
    times = 1 + np.cumsum(rng.integers(1, 2**40, count))
    delays = rng.integers(0, 2**40, count)
    columns = rotation_to_6d(Rotation.random(count, rng=rng).as_matrix())
    yaw = rng.uniform(-np.pi, np.pi, count)
    scale = 10.0 ** rng.uniform(-12, 3)
    free = rng.normal(0, scale, (count, 9))
    pose = np.column_stack([free[:, :3], columns, free[:, 3]])
    camera = np.column_stack([free[:, 4:6], np.cos(yaw), np.sin(yaw), free[:, 6]])
    values = {"robot": pose, "camera": camera, "force": free[:, :3], "joints": free[:, :7]}
    values["other"] = free[:, :2]
    streams = {n: StreamSamples(n, times, times + delays, v) for n, v in values.items()}
    written = RecordedEpisode(
        "00000000-0000-0000-0000-000000000002", streams, ((5, 6, "approach"),), {"k": "ä"}
    )
    assert_same(parse_episode(episode_bytes(written), where="x"), written)


def test_overtaken_samples_keep_the_order_of_the_sensor(factory):
    written = factory.episode(0)
    camera = written.streams["camera"]
    receive = camera.receive_time_ns.copy()
    receive[2], receive[3] = receive[3] + 40_000_000, receive[2]
    written = factory.with_stream(written, "camera", receive_time_ns=receive)
    assert_same(parse_episode(episode_bytes(written), where="x"), written)


def test_not_a_number_survives_so_that_the_contract_can_name_its_row(factory):
    written = factory.episode(0)
    values = written.streams["robot"].values.copy()
    values[4, 1] = values[5, 9] = np.nan
    read = parse_episode(
        episode_bytes(factory.with_stream(written, "robot", values=values)), where="x"
    )
    assert np.argwhere(np.isnan(read.streams["robot"].values)).tolist() == [[4, 1], [5, 9]]


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


def test_layout_topics_are_unique():
    names = [topic.name for topics in LAYOUT.values() for topic in topics]
    assert len(set(names)) == len(names)


def test_samples_must_agree_in_length():
    with pytest.raises(ContractError, match="one row per sample"):
        StreamSamples("s", np.arange(3), np.arange(2), np.zeros((3, 1)))


def test_samples_are_read_only_copies(factory):
    samples = factory.episode(0).streams["robot"]
    with pytest.raises(ValueError, match="read-only"):
        samples.values[0, 0] = 1.0
    source = np.zeros((2, 1))
    copy = StreamSamples("s", np.arange(2), np.arange(2), source)
    source[:] = 7.0
    assert replace(copy).values.max() == 0.0
