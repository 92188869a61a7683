"""Recordings that break the contract: refused by name, with the row and the reason."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genpolicy.data.checks import check_recording
from genpolicy.data.ingest import accept_recording
from genpolicy.data.recording.writer import write_episode
from genpolicy.data.resample import remove_clock_offsets
from genpolicy.errors import ContractError, NonFiniteError

LIMITS = ((-2.9,) * 7, (2.9,) * 7)


@pytest.fixture
def accept(factory, tmp_path):
    def run(recorded, **changes):
        write_episode(tmp_path / "one.mcap", recorded)
        episode, _ = accept_recording(
            tmp_path / "one.mcap", contract=factory.contract(**changes), label="one.mcap"
        )
        return episode

    return run


def edited(factory, stream, row, column, value, **options):
    recorded = factory.episode(0, steps=30, **options)
    values = recorded.streams[stream].values.copy()
    values[row, column] = value
    return factory.with_stream(recorded, stream, values=values)


def test_good_recording_is_accepted_with_its_joints(factory, accept):
    episode = accept(factory.episode(0, joints=True), joint_range_rad=LIMITS)
    assert episode.source_file == "one.mcap"
    assert episode.rows.observation.shape == (12, factory.OBSERVATION.dim)


@pytest.mark.parametrize(
    ("stream", "column", "name"),
    [("robot", 1, "tcp_position_m.y"), ("action", 9, "action.gripper_opening_m")],
)
def test_nan_is_named_with_its_row(factory, accept, stream, column, name):
    with pytest.raises(NonFiniteError, match=rf"stream {stream}, row 17, column {name} is nan"):
        accept(edited(factory, stream, 17, column, np.nan))


def test_millimetres_for_metres(factory, accept):
    recorded = factory.episode(0)
    values = recorded.streams["robot"].values.copy()
    values[:, :3] *= 1000.0
    with pytest.raises(ContractError, match=r"row 0, column tcp_position_m.x is 2\d\d.*not mm"):
        accept(factory.with_stream(recorded, "robot", values=values))
    action = recorded.streams["action"].values.copy()
    action[:, 9] = 40.0
    with pytest.raises(ContractError, match=r"action\.gripper_opening_m is 40"):
        accept(factory.with_stream(recorded, "action", values=action))


def test_degrees_for_radians(factory, accept):
    recorded = factory.episode(0, joints=True)
    degrees = np.rad2deg(recorded.streams["joints"].values)
    recorded = factory.with_stream(recorded, "joints", values=degrees)
    with pytest.raises(ContractError, match=r"stream joints, row 0, column joint_1_rad.*degrees"):
        accept(recorded, joint_range_rad=LIMITS)


def test_constant_joints_and_constant_tcp_while_the_action_moves(factory, accept):
    recorded = factory.episode(0, steps=30, joints=True)
    for stream in ("joints", "robot"):
        values = recorded.streams[stream].values.copy()
        values[40:] = values[40]
        frozen = factory.with_stream(recorded, stream, values=values)
        with pytest.raises(ContractError, match=rf"stream {stream}, row 40 is constant for"):
            accept(frozen)
        with_effect = replace(factory.contract(), frozen_s=60.0)
        check_recording(remove_clock_offsets(frozen, where="x"), with_effect, where="x")


def test_robot_at_rest_while_the_action_rests_is_no_fault(factory, accept):
    recorded = factory.episode(0, steps=30)
    for stream in ("robot", "action"):
        values = recorded.streams[stream].values.copy()
        values[:] = values[0]
        recorded = factory.with_stream(recorded, stream, values=values)
    accept(recorded)


@pytest.mark.parametrize("stream", ["action", "camera", "robot"])
def test_missing_stream(factory, accept, stream):
    with pytest.raises(ContractError, match=f"stream {stream} is missing"):
        accept(factory.without_stream(factory.episode(0), stream))


def test_gap_and_clock_backwards_and_negative_age(factory, accept):
    recorded = factory.episode(0, steps=30)
    camera = recorded.streams["camera"]
    keep = np.r_[0:10, 25 : len(camera)]
    cut = {n: getattr(camera, n)[keep] for n in ("event_time_ns", "receive_time_ns", "values")}
    with pytest.raises(ContractError, match=r"camera, row 10: event time is a gap of 0\.5"):
        accept(factory.with_stream(recorded, "camera", **cut))
    times = camera.event_time_ns.copy()
    times[5] = times[4]
    with pytest.raises(ContractError, match="camera, row 5: event time is 0 ns later"):
        accept(factory.with_stream(recorded, "camera", event_time_ns=times))
    early = camera.receive_time_ns.copy()
    early[7] -= 40_000_000
    with pytest.raises(ContractError, match=r"camera, row 7: receive time.*negative age"):
        accept(factory.with_stream(recorded, "camera", receive_time_ns=early))


def test_wrong_declared_clock_offset_shows_as_negative_age(factory, accept):
    recorded = factory.episode(0)
    metadata = {**recorded.metadata, "clock_offset_robot_ns": "-9000000"}
    with pytest.raises(ContractError, match=r"stream robot, row 0: receive time"):
        accept(replace(recorded, metadata=metadata))


def test_missing_action_tick(factory, accept):
    recorded = factory.episode(0)
    action = recorded.streams["action"]
    keep = np.delete(np.arange(len(action)), 5)
    cut = {n: getattr(action, n)[keep] for n in ("event_time_ns", "receive_time_ns", "values")}
    with pytest.raises(ContractError, match="action, row 5: event time is a gap"):
        accept(factory.with_stream(recorded, "action", **cut))


@pytest.mark.parametrize(
    ("key", "value", "match"),
    [
        ("operator", "", "metadata operator is missing"),
        ("outcome", "great", "metadata outcome is 'great'"),
        ("is_recovery", "maybe", "metadata is_recovery is 'maybe'"),
        ("clock_offset_camera_ns", "soon", "clock_offset_camera_ns is 'soon'"),
        ("clock_offset_camera_ns", "9" * 30, "camera: declared clock offset"),
        ("clock_offset_camera_ns", "-9223372036854775807", "camera: declared clock offset"),
        ("clock_offset_phase_ns", "9" * 19, "phase: declared clock offset"),
        ("scene_start", "{", "scene_start is not JSON"),
        ("scene_start", "[" * 100_000, "scene_start is not JSON"),
    ],
)
def test_metadata(factory, accept, key, value, match):
    recorded = factory.episode(0)
    with pytest.raises(ContractError, match=match):
        accept(replace(recorded, metadata={**recorded.metadata, key: value}))


def test_phases(factory, accept):
    recorded = factory.episode(0)
    with pytest.raises(ContractError, match="phase is without events"):
        accept(replace(recorded, phase_events=()))
    events = (*recorded.phase_events[:1], (*recorded.phase_events[1][:2], "dance"))
    with pytest.raises(ContractError, match="phase, row 1 is 'dance'"):
        accept(replace(recorded, phase_events=events))
    twice = (recorded.phase_events[0], recorded.phase_events[0])
    with pytest.raises(ContractError, match="phase, row 1: event time"):
        accept(replace(recorded, phase_events=twice))


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(["robot", "force", "camera", "action"]),
    st.integers(0, 11),
    st.sampled_from([np.nan, np.inf, -np.inf, 1e6, -1e6]),
    st.data(),
)
def test_no_wild_number_passes_anywhere(factory, stream, row, value, data):
    recorded = factory.episode(0)
    values = recorded.streams[stream].values.copy()
    column = data.draw(st.integers(0, values.shape[1] - 1))
    values[row, column] = value
    changed = factory.with_stream(recorded, stream, values=values)
    place = rf"stream {stream}, row {row}, column"
    with pytest.raises(ContractError, match=place):
        check_recording(remove_clock_offsets(changed, where="x"), factory.contract(), where="x")
