"""Streams that freeze or lose samples while the arm moves, and streams that stand by nature."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms

from genpolicy.audit.semantics import measure
from genpolicy.audit.semantics.frozen import late_share, longest_holds
from genpolicy.seeds import stream

ROWS_OF_LIMIT = 6  # 0.3 s at 20 Hz


def found(data, settings=SETTINGS):
    return measure(data, settings).findings


def with_camera(data, *, noise=1e-3, seed=7):
    """A camera that sees a thing that stands, every row anew and with noise of its own."""
    rng = stream(seed, "scene")
    width, rows = data.observation.shape[1], len(data.observation)
    place = rng.uniform(-0.1, 0.1, (len(data.episodes), 2))[data.episode]
    shown = place + noise * rng.normal(size=(rows, 2))
    return replace(
        data, observation=np.hstack([data.observation, shown]),
        observation_names=(*data.observation_names, "u", "v"),
        observation_scale=np.append(data.observation_scale, [0.01, 0.01]),
        streams={"robot": slice(0, width), "camera": slice(width, width + 2)},
    )  # fmt: skip


def frozen(data, episodes, rows, columns=slice(3, 5), first=20):
    """The columns repeat the last value so many rows, in the middle of the motion."""
    values = data.observation.copy()
    for episode in episodes:
        at = int(np.searchsorted(data.episode, episode)) + first
        values[at + 1 : at + 1 + rows, columns] = values[at, columns]
    return replace(data, observation=values)


@pytest.mark.parametrize(("columns", "name"), [(slice(0, 3), "robot"), (slice(3, 5), "camera")])
def test_a_stream_that_freezes_in_some_episodes_is_named_before_its_clock(columns, name):
    data = with_camera(arms(91))
    assert found(data) == ()
    first = found(frozen(data, (3, 17, 40), 25, columns))[0]
    assert (first.kind, first.variable, first.question) == ("frozen", name, "frozen_s")
    assert first.measured == pytest.approx(25 / 20, abs=0.15) and first.floor == 0.3
    assert "ep0003, ep0017, ep0040" in first.where


def test_one_episode_or_a_short_stretch_is_no_finding():
    data = with_camera(arms(92))
    assert found(frozen(data, (3,), 25)) == ()
    assert found(frozen(data, range(0, 60, 3), ROWS_OF_LIMIT)) == ()
    assert [f.kind for f in found(frozen(data, range(0, 60, 3), ROWS_OF_LIMIT + 2))] == ["frozen"]


def test_what_stands_while_the_arm_rests_has_not_frozen():
    data = with_camera(arms(93))
    at_rest = arms(93)
    ends = np.searchsorted(data.episode, np.arange(60), side="right")
    values, action = data.observation.copy(), at_rest.action.copy()
    for end in ends[::3]:
        action[end - 20 : end] = action[end - 20]
        values[end - 20 : end] = values[end - 20]
    assert "frozen" not in {f.kind for f in found(replace(data, observation=values, action=action))}


def test_a_column_that_repeats_beside_live_ones_of_its_stream_has_not_frozen():
    data = with_camera(arms(94))
    assert found(frozen(data, range(0, 60, 3), 30, slice(3, 4))) == ()


def test_a_camera_slower_than_the_rows_is_measured_by_its_own_cadence():
    data = with_camera(arms(95))
    held = data.index // 4 * 4
    at = np.searchsorted(data.episode, data.episode) + held
    slow = data.observation.copy()
    slow[:, 3:] = slow[at, 3:]
    data = replace(data, observation=slow)
    assert found(data) == () and measure(data, SETTINGS).untold_freezes == ()
    assert found(frozen(data, (3, 17, 40), 12)) == ()  # five times its usual stretch are 15 rows
    assert found(frozen(data, (3, 17, 40), 25))[0].kind == "frozen"


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_a_scene_that_stands_in_most_episodes_tells_nothing_and_is_said_to(noise):
    """Without noise, or looked at once: frozen or not, it reads the same."""
    data = with_camera(arms(96), noise=noise)
    if noise:
        data = frozen(data, range(60), 100, first=0)
    result = measure(data, SETTINGS)
    assert result.findings == () and result.untold_freezes == ("camera",)
    assert measure(with_camera(arms(96)), SETTINGS).untold_freezes == ()


def test_a_stream_without_scale_is_none():
    data = with_camera(arms(97), noise=0.0)
    ignored = replace(data, observation_scale=np.array([0.01] * 3 + [np.inf] * 2))
    assert measure(ignored, SETTINGS).untold_freezes == ()


def test_without_a_pair_the_whole_action_tells_whether_the_arm_moves():
    data = replace(with_camera(arms(98)), paired=False)
    assert found(data) == ()
    assert [f.kind for f in found(frozen(data, (3, 17, 40), 25))] == ["frozen"]


def test_holds_by_hand():
    values = np.array([[0.0], [0.0], [0.0], [1.0], [1.0], [1.0], [1.0], [1.0]])
    moving = np.array([False, True, True, True, True, False, True, True])
    starts = np.array([0, 5, 8])
    assert longest_holds(values, moving, starts).tolist() == [2, 2]
    assert longest_holds(values, moving, np.array([0, 0, 5, 8])).tolist() == [0, 2, 2]


def stamped(data, lost, *, age_s=0.03, every=1):
    """Stamps of a camera whose lost frames are replaced by the last one that came."""
    first = np.searchsorted(data.episode, data.episode)
    fresh = ~lost & (data.index % every == 0) | (data.index == 0)
    newest = np.maximum.accumulate(np.where(fresh, np.arange(len(lost)), 0))
    newest = np.maximum(newest, first)
    return replace(data, stream_time_s={"camera": data.event_time_s[newest] - age_s})


def test_lost_frames_are_gaps_of_their_stream():
    data = with_camera(arms(99))
    rng = stream(3, "lost")
    assert found(stamped(data, np.zeros(len(data.observation), dtype=bool))) == ()
    single = rng.random(len(data.observation)) < 0.04
    assert found(stamped(data, single)) == ()  # late by one frame, as a slow link is
    many = rng.random(len(data.observation)) < 0.2
    (finding,) = found(stamped(data, many))
    assert (finding.kind, finding.variable, finding.question) == ("gaps", "camera", "gap_share")
    assert finding.measured == pytest.approx(0.04, abs=0.01)


def test_a_slow_camera_and_a_drifting_clock_have_no_gaps():
    data = with_camera(arms(100))
    starts = np.searchsorted(data.episode, np.arange(61))
    none = np.zeros(len(data.observation), dtype=bool)
    slow = stamped(data, none, every=4)
    assert late_share(slow, starts, slow.stream_time_s["camera"]) == 0.0
    drifting = data.event_time_s + 0.004 * data.index
    assert late_share(data, starts, drifting) == 0.0
    once = stamped(data, ~(data.index == 0))
    assert late_share(once, starts, once.stream_time_s["camera"]) == 0.0
