"""Clocks: lag by episode, offsets of epochs and single episodes, drift, streams, realignment."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms, last_epoch, late, parts, rebuilt, some

from genpolicy.audit.semantics import episode_lags, measure, realigned
from genpolicy.audit.semantics.clocks import offset_findings
from genpolicy.audit.semantics.drift import drift_findings
from genpolicy.audit.semantics.lags import segment_lags
from genpolicy.audit.semantics.robust import densest_half
from genpolicy.seeds import stream


def kinds(data, settings=SETTINGS):
    return [finding.kind for finding in measure(data, settings).findings]


def walk(n, width, seed=1):
    return np.cumsum(np.cumsum(stream(seed, "walk").normal(size=(n, width)), axis=0), axis=0)


@pytest.mark.parametrize("lag", [-3, 0, 2, 7])
def test_a_whole_lag_is_found_exactly(lag):
    path = walk(80, 2)
    leading, trailing = path[20:70], path[20 - lag : 70 - lag]
    found = segment_lags(leading, trailing, np.array([0, 50]), 10)
    assert found.steps[0] == pytest.approx(lag, abs=0.02)


@pytest.mark.parametrize("lag", [0.25, 1.5, 2.75])
def test_a_fraction_of_a_row_is_found(lag):
    times = np.arange(60.0)
    leading = np.stack([np.sin(times / 5), np.cos(times / 7)], axis=1)
    trailing = np.stack([np.sin((times - lag) / 5), np.cos((times - lag) / 7)], axis=1)
    found = segment_lags(leading, trailing + 5.0, np.array([0, 60]), 10)
    assert found.steps[0] == pytest.approx(lag, abs=0.03)


def test_segments_do_not_touch_each_other():
    path = walk(400, 3)
    starts = np.array([0, 90, 100, 250, 400])
    together = segment_lags(path[:-3], path[3:], starts - np.array([0, 0, 0, 0, 3]), 8).steps
    for number, (a, b) in enumerate([(0, 90), (100, 250)]):
        alone = segment_lags(path[a:b], path[a + 3 : b + 3], np.array([0, b - a]), 8)
        assert together[2 * number] == pytest.approx(alone.steps[0], abs=0.02)
    assert np.isnan(together[1])  # ten rows say nothing


def test_what_does_not_move_or_follow_has_no_lag():
    rng = stream(2, "still")
    still, noise = np.ones((60, 2)), rng.normal(size=(60, 2))
    edges = np.array([0, 60])
    assert np.isnan(segment_lags(still, noise, edges, 8).steps[0])
    assert np.isnan(segment_lags(walk(60, 2), noise, edges, 8).steps[0])


def test_straight_motion_at_one_speed_does_not_tell_a_lag():
    # Any shift is a constant offset; what the noise prefers must not count.
    rng = stream(4, "straight")
    ramp = np.linspace(0.0, 3.0, 60)[:, None] * np.ones((1, 2))
    edges = np.arange(0, 60 * 30 + 1, 60)
    leading = np.vstack([ramp] * 30)
    trailing = leading - 0.1 + 0.003 * rng.normal(size=leading.shape)
    assert np.isnan(segment_lags(leading, trailing, edges, 8).steps).mean() >= 0.9


def test_an_episode_is_off_only_beyond_its_own_error():
    data = arms(21)
    offsets = 0.1 + 0.001 * stream(7, "offsets").normal(size=60)
    offsets[[3, 9, 27, 40]] += 0.08
    limits = {"declared_s": None, "finest_s": 0.0125, "episode_limit_s": 0.0375}
    sure, taken = offset_findings(
        "robot", offsets, data, SETTINGS, **limits, errors_s=np.full(60, 0.002)
    )
    assert [d.kind for d in sure] == ["clock"] and np.flatnonzero(taken).tolist() == [3, 9, 27, 40]
    unsure, taken = offset_findings(
        "robot", offsets, data, SETTINGS, **limits, errors_s=np.full(60, 0.03)
    )
    assert unsure == [] and not taken.any()


def test_the_densest_half_stays_in_one_cluster():
    rng = stream(3, "half")
    values = np.concatenate([rng.normal(size=600), 50 + rng.normal(size=500)])
    centre, spread = densest_half(values)
    assert abs(centre) < 1.0 and 0.5 < spread < 3.0
    assert densest_half(rng.normal(size=2000))[1] == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(("rate_hz", "width", "unit"), [(5, 2, 1.0), (20, 3, 500.0), (40, 7, 1.0)])
def test_an_epoch_that_is_late_by_a_row_is_named_at_any_rate_and_in_any_unit(rate_hz, width, unit):
    data = arms(11, rate_hz=rate_hz, width=width, unit=unit)
    assert kinds(data) == []
    found = measure(late(data, 1.0, last_epoch(data)), SETTINGS)
    assert found.findings[0].kind == "clock" and "epoch e" in found.findings[0].where
    offsets = {clock.epoch: clock.offset_before_s for clock in found.clocks}
    assert offsets["e1"] - offsets["e0"] == pytest.approx(1 / rate_hz, abs=0.2 / rate_hz)


def test_a_minority_of_late_episodes_is_named_and_put_right():
    data = arms(12)
    chosen = some(data, 0.15)
    found = measure(late(data, 2.0, chosen), SETTINGS)
    assert [finding.kind for finding in found.findings] == ["clock"]
    assert f"{chosen.sum()} of" in found.findings[0].action
    assert found.shift_steps.tolist() == (2 * chosen).tolist()
    shifted, moved = realigned(late(data, 2.0, chosen), found)
    assert moved and kinds(shifted) == []


def test_one_late_episode_is_no_defect_of_the_data_set():
    data = arms(13, episodes=100)
    one = np.arange(100) == 41
    assert kinds(late(data, 3.0, one)) == []


def test_a_drift_along_the_episode_is_named():
    data = arms(14, epochs=1)
    drifting = late(data, lambda n: np.linspace(-2, 2, n), np.ones(60, dtype=bool))
    found = measure(drifting, SETTINGS).findings
    assert found[0].kind == "clock_drift" and found[0].unit == "steps per episode"
    assert found[0].measured == pytest.approx(4, rel=0.3)


def test_a_drift_within_the_spread_of_episodes_is_the_way_of_moving():
    data = arms(22, epochs=1, episodes=400)
    rng = stream(8, "drifts")
    assert drift_findings(2.0 + 0.3 * rng.normal(size=400), data, SETTINGS)
    assert not drift_findings(2.0 + 3.0 * rng.normal(size=400), data, SETTINGS)


@pytest.mark.parametrize("shape", ["step", "trend"])
def test_a_lag_that_changes_over_the_recordings_is_named(shape):
    data = arms(15, epochs=1, episodes=80)
    commands, seen = parts(data)
    for k in range(80):
        steps = 2.5 * (k >= 50) if shape == "step" else 3.0 * k / 79
        n = len(seen[k])
        at = np.clip(np.arange(n) - steps, 0, n - 1)
        seen[k] = np.stack([np.interp(at, np.arange(n), c) for c in seen[k].T], axis=1)
    found = measure(rebuilt(data, commands, seen), SETTINGS).findings
    assert found[0].kind in ("clock", "clock_drift")


def test_a_response_before_its_command_is_named_everywhere():
    data = arms(16, epochs=1, lag_s=0.01)
    assert kinds(data) == []
    assert kinds(late(data, -3.0, np.ones(60, dtype=bool))) == ["clock"]
    declared = SETTINGS.model_copy(update={"declared_lag_steps": 4.0})
    assert "clock" in kinds(data, declared)


def with_camera(data, steps_last_epoch):
    """A second stream that sees the arm in its own axes, four rows late and more."""
    _, seen = parts(data)
    rng = stream(5, "camera")
    view = rng.normal(size=(seen[0].shape[1], 2))
    shown = []
    for k, part in enumerate(seen):
        n = len(part)
        at = np.clip(np.arange(n) - 4.0 - steps_last_epoch * last_epoch(data)[k], 0, n - 1)
        view_late = np.stack([np.interp(at, np.arange(n), c) for c in (part @ view).T], axis=1)
        shown.append(view_late + 0.002 * rng.normal(size=view_late.shape))
    width = data.observation.shape[1]
    return replace(
        data, observation=np.hstack([data.observation, np.vstack(shown)]),
        observation_names=(*data.observation_names, "u", "v"),
        observation_scale=np.append(data.observation_scale, [0.01, 0.01]),
        streams={"robot": slice(0, width), "camera": slice(width, width + 2)},
    )  # fmt: skip


def test_a_camera_that_sees_the_arm_is_judged_by_that_motion():
    data = arms(17)
    assert kinds(with_camera(data, 0.0)) == []
    found = measure(with_camera(data, 2.0), SETTINGS)
    assert {(d.kind, d.variable) for d in found.findings} == {("clock", "camera")}
    shifted, moved = realigned(with_camera(data, 2.0), found)
    assert moved and kinds(shifted) == []


def test_an_offset_of_the_robot_is_not_said_of_the_camera():
    data = arms(18)
    # The camera shows the arm as it is; only the robot's stamps are off in the last epoch.
    true = with_camera(data, 0.0)
    shifted = late(data, 2.0, last_epoch(data))
    seen = true.observation.copy()
    seen[:, :3] = shifted.observation
    found = measure(replace(true, observation=seen), SETTINGS).findings
    assert {d.variable for d in found} == {"robot"}


def test_receive_delays_judge_a_stream_that_does_not_move():
    data = arms(19)
    rng = stream(6, "delay")
    delay = rng.uniform(0.02, 0.06, len(data.observation))
    quiet = replace(data, delay_s={"camera": delay})
    assert kinds(quiet) == []
    ahead = np.where(last_epoch(data)[data.episode], 0.06, 0.0)
    found = measure(replace(data, delay_s={"camera": delay + 0.06 - ahead}), SETTINGS).findings
    assert (found[0].kind, found[0].variable) == ("clock", "camera")
    ramp = delay + 0.08 * data.index / 70
    assert kinds(replace(data, delay_s={"camera": ramp})) == ["clock_drift"] * 2
    assert kinds(replace(data, delay_s={"camera": delay - 0.03})) == ["clock"]


def test_an_unpaired_action_has_no_lag_and_no_finding():
    data = arms(20)
    nothing = np.zeros(0, dtype=np.int64)
    leader = replace(data, paired=False, observation_position=nothing)
    found = measure(leader, SETTINGS)
    assert found.findings == () and np.isnan(episode_lags(leader, 12)).all()
    assert all(clock.lag_steps is None for clock in found.clocks)
