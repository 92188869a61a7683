"""Lag of a response behind its command: found, or said to be unknown."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms
from planar import planar

from genpolicy.audit.data import canonical
from genpolicy.audit.semantics import episode_lags, measure
from genpolicy.audit.semantics.lags import segment_lags
from genpolicy.seeds import stream


@pytest.mark.parametrize("steps", [0, 2, 5])
def test_lag_is_recovered(steps):
    data = canonical(planar(episodes=20, clock_steps=steps)[0])
    lags = episode_lags(data, 12)
    late = data.episodes.calibration_epoch == "epoch_2"
    assert np.nanmedian(lags[late]) == pytest.approx(1 + steps, abs=0.15)
    assert np.nanmedian(lags[~late]) == pytest.approx(1, abs=0.15)


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


def test_an_unpaired_action_has_no_lag_and_no_finding():
    data = arms(20)
    nothing = np.zeros(0, dtype=np.int64)
    leader = replace(data, paired=False, observation_position=nothing)
    found = measure(leader, SETTINGS)
    assert found.findings == () and np.isnan(episode_lags(leader, 12)).all()
    assert all(clock.lag_rows is None for clock in found.clocks)
