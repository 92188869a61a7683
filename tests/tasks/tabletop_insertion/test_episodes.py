from dataclasses import replace

import numpy as np
import pytest

from genpolicy.tasks.tabletop_insertion.episodes import demonstrate, record_episode, replay
from genpolicy.tasks.tabletop_insertion.plans import travel
from genpolicy.tasks.tabletop_insertion.sessions import episode_specs
from genpolicy.tasks.tabletop_insertion.start import start_from_json

SPECS = episode_specs(21, 24, shares={"nominal": 1.0})


@pytest.fixture(scope="module")
def nominal():
    return [demonstrate(spec) for spec in SPECS]


def test_undisturbed_operators_succeed(nominal):
    assert sum(done.success for done in nominal) >= 0.95 * len(nominal)


def test_operators_keep_to_their_limits(nominal):
    for done in nominal:
        steps = np.linalg.norm(np.diff(done.actions[:, :3], axis=0), axis=1)
        assert steps.max() / 0.05 < 0.5
        acceleration = np.diff(done.actions[:, :3], n=2, axis=0) / 0.05**2
        assert np.linalg.norm(acceleration, axis=1).max() < 2.5


def test_the_mean_of_left_and_right_runs_into_the_post(nominal):
    left = next(d for s, d in zip(SPECS, nominal, strict=True) if s.mode == "left")
    right = next(d for s, d in zip(SPECS, nominal, strict=True) if s.mode == "right")
    mean = 0.5 * (left.actions[:16] + right.actions[:16])
    # The hand's front face is 30 mm before the TCP, the post's surface at x = 0.475 m.
    assert mean[-1, 0] + 0.030 > 0.475
    assert abs(mean[-1, 1]) < 0.06
    for done in (left, right):
        assert abs(done.actions[15, 1]) > 0.10


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


def test_travel_starts_and_ends_at_rest_and_keeps_its_speed():
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.1, 0.0], [0.3, 0.0, 0.1]])
    path = travel(points, speed_m_s=0.3, acceleration_m_s2=1.2)
    np.testing.assert_allclose(path[-1], points[-1], atol=1e-9)
    speed = np.linalg.norm(np.diff(np.vstack([points[:1], path]), axis=0), axis=1) / 0.05
    assert speed.max() <= 0.3 * 1.001
    assert speed[0] < 0.05 and speed[-1] < 0.05
    np.testing.assert_array_equal(
        travel(points[:1].repeat(2, axis=0), speed_m_s=1, acceleration_m_s2=1), points[:1]
    )
