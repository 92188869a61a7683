"""Clocks of streams that move with the arm."""

from dataclasses import replace

import numpy as np
from arms import SETTINGS, arms, last_epoch, late, parts

from genpolicy.audit.semantics import measure, realigned
from genpolicy.seeds import stream


def kinds(data, settings=SETTINGS):
    return [finding.kind for finding in measure(data, settings).findings]


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
