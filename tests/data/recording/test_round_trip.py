"""Write, read, compare: a property, a golden file hash, and the library's reader as a witness."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.data.recording.episode import RecordedEpisode, StreamSamples
from genpolicy.data.recording.reader import parse_episode, read_episode
from genpolicy.data.recording.writer import episode_bytes, write_episode

TOLERANCE = 1e-12


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
