"""Recorded episodes: recoveries and failures are what their labels say, and replay."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.tasks.tabletop_insertion.episodes import demonstrate, record_episode, replay
from genpolicy.tasks.tabletop_insertion.sessions import episode_specs
from genpolicy.tasks.tabletop_insertion.start import start_from_json

SPECS = episode_specs(21, 24, shares={"nominal": 1.0})


@pytest.mark.parametrize("kind", ["pushed", "wander"])
def test_recovered_episodes_show_the_recovery_and_succeed(kind):
    for spec in SPECS[:4]:
        done = demonstrate(replace(spec, kind=kind))
        assert "recover" in done.phases
        assert done.success


@pytest.mark.parametrize("kind", ["missed", "dropped"])
def test_failures_are_labelled_so_and_replay_so(kind):
    for spec in SPECS[:3]:
        episode = record_episode(replace(spec, kind=kind))
        assert episode.metadata["outcome"] == "failure"
        assert replay(spec.start, episode.streams["action"].values) == "failure"


def test_recording_is_a_function_of_its_plan():
    first, second = record_episode(SPECS[0]), record_episode(SPECS[0])
    other = record_episode(replace(SPECS[0], root_seed=22))
    assert first.metadata == second.metadata
    assert first.phase_events == second.phase_events
    for name, samples in first.streams.items():
        again = second.streams[name]
        assert samples.values.tobytes() == again.values.tobytes()
        assert samples.event_time_ns.tobytes() == again.event_time_ns.tobytes()
        assert samples.receive_time_ns.tobytes() == again.receive_time_ns.tobytes()
    assert first.streams["robot"].values.tobytes() != other.streams["robot"].values.tobytes()
    assert first.episode_uuid != other.episode_uuid


def test_recorded_actions_replay_to_the_label():
    for spec in SPECS[:3]:
        episode = record_episode(spec)
        start = start_from_json(episode.metadata["scene_start"])
        assert start == spec.start
        assert replay(start, episode.streams["action"].values) == episode.metadata["outcome"]


def test_streams_have_own_rates_clocks_and_delays():
    spec = SPECS[0]
    episode = record_episode(spec)
    for name, period_s in (("robot", 0.01), ("force", 0.01), ("camera", 1 / 30), ("action", 0.05)):
        samples = episode.streams[name]
        spacing = np.diff(samples.event_time_ns) / 1e9
        np.testing.assert_allclose(spacing, period_s, atol=1e-6)
        declared = int(episode.metadata[f"clock_offset_{name}_ns"])
        first_event = samples.event_time_ns[0] - declared
        assert abs(first_event - spec.start_time_ns) < 3_000_000
        delay = samples.receive_time_ns - (samples.event_time_ns - declared)
        assert delay.min() > -3_000_000
        assert np.all(np.diff(samples.receive_time_ns) >= 0)
    camera = episode.streams["camera"]
    delay = (
        camera.receive_time_ns
        - camera.event_time_ns
        + int(episode.metadata["clock_offset_camera_ns"])
    )
    assert delay.min() > 0.015e9 and delay.max() < 0.065e9
