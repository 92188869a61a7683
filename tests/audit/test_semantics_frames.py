"""Units, frames, columns, turns of an angle, calibration: what is turned, scaled or beside."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms, last_epoch, late, parts, rebuilt, some

from genpolicy.audit.semantics import measure
from genpolicy.audit.semantics.frames import _assignment
from genpolicy.audit.semantics.motion import make_motion


def mapped(data, chosen, change):
    commands, seen = parts(data)
    seen = [change(part) if chosen[k] else part for k, part in enumerate(seen)]
    return rebuilt(data, commands, seen)


def first(data, settings=SETTINGS):
    findings = measure(data, settings).findings
    return (findings[0].kind, findings[0].where) if findings else ("", "")


@pytest.mark.parametrize("factor", [1000.0, 180 / np.pi, 10.0, 1 / 25.4, 0.001])
@pytest.mark.parametrize("share", ["epoch", "all", "some"])
def test_a_unit_is_named_wherever_it_is(factor, share):
    data = arms(30)
    chosen = {"epoch": last_epoch(data), "all": np.ones(60, dtype=bool), "some": some(data, 0.1)}
    found = measure(mapped(data, chosen[share], lambda part: factor * part), SETTINGS).findings
    assert {finding.kind for finding in found} == {"unit"}
    assert any(d.measured == pytest.approx(max(factor, 1 / factor), rel=0.1) for d in found)


def test_the_action_names_the_units_it_may_be():
    data = arms(31)
    found = measure(mapped(data, last_epoch(data), lambda part: 1000 * part), SETTINGS).findings
    assert "as between m and mm" in found[0].action


def test_one_joint_in_degrees_is_named():
    data = arms(32, width=7)
    scale = np.ones(7)
    scale[4] = 180 / np.pi
    found = measure(mapped(data, np.ones(60, dtype=bool), lambda part: part * scale), SETTINGS)
    assert {d.kind for d in found.findings} == {"unit"}


def test_episodes_that_are_wholly_in_another_unit_are_named():
    data = arms(33)
    commands, seen = parts(data)
    for k in np.flatnonzero(some(data, 0.1)):
        commands[k], seen[k] = 1000 * commands[k], 1000 * seen[k]
    assert first(rebuilt(data, commands, seen))[0] == "unit"


@pytest.mark.parametrize("factor", [10.0, 1000.0])
def test_a_context_channel_in_another_unit_is_named(factor):
    data = arms(34)
    rng = np.random.default_rng(1)
    goal = (np.array([0.5, 0.0]) + 0.05 * rng.normal(size=(60, 2)))[data.episode]
    quiet = replace(data, observation=np.hstack([data.observation, goal]),
                    observation_names=(*data.observation_names, "gx", "gy"),
                    observation_scale=np.full(5, 0.01), context={"goal": slice(3, 5)})  # fmt: skip
    assert first(quiet) == ("", "")
    off = np.where(last_epoch(data)[data.episode][:, None], factor, 1.0)
    spoiled = np.hstack([data.observation, goal * off])
    found = measure(replace(quiet, observation=spoiled), SETTINGS).findings
    assert (found[0].kind, found[0].variable) == ("unit", "goal")


def test_an_object_that_stands_elsewhere_or_near_zero_is_no_unit():
    # Three in ten goals stand six times as far out; an angle passes through zero.
    data = arms(44)
    rng = np.random.default_rng(2)
    near = rng.random(60) < 0.7
    goal = np.where(near, 0.1, 0.6) + 0.005 * rng.normal(size=60)
    angle = 0.8 + 0.2 * rng.normal(size=60)
    angle[:6] = 0.02 * rng.normal(size=6)
    columns = np.stack([goal, angle], axis=1)[data.episode]
    found = measure(replace(
        data, observation=np.hstack([data.observation, columns]),
        observation_names=(*data.observation_names, "goal", "angle"),
        observation_scale=np.full(5, 0.01),
        context={"goal": slice(3, 4), "angle": slice(4, 5)},
    ), SETTINGS)  # fmt: skip
    assert found.findings == ()


def turned(degrees, width=3):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.eye(width)
    matrix[:2, :2] = [[c, -s], [s, c]]
    return matrix


@pytest.mark.parametrize("width", [2, 3])
@pytest.mark.parametrize("degrees", [15, 45, 180])
@pytest.mark.parametrize("everywhere", [True, False])
def test_a_turned_frame_is_named_with_its_angle(width, degrees, everywhere):
    data = arms(35, width=width)
    chosen = np.ones(60, dtype=bool) if everywhere else last_epoch(data)
    spoiled = mapped(data, chosen, lambda part: part @ turned(degrees, width).T)
    found = measure(spoiled, SETTINGS).findings
    assert {finding.kind for finding in found} == {"frame"}
    assert np.degrees(found[0].measured) == pytest.approx(degrees, abs=2)


def test_a_small_turn_is_no_frame_and_no_clock():
    data = arms(36, width=2)
    found = measure(mapped(data, last_epoch(data), lambda p: p @ turned(3, 2).T), SETTINGS).findings
    assert {finding.kind for finding in found} <= {"calibration"}


@pytest.mark.parametrize("share", [0.1, 0.3, 1.0])
def test_mirrored_episodes_are_named(share):
    data = arms(37, width=2)
    chosen = some(data, share)
    kind, where = first(mapped(data, chosen, lambda part: part * np.array([1.0, -1.0])))
    assert kind == "frame"
    assert share == 1.0 or "episodes (ep" in where


@pytest.mark.parametrize("width", [2, 3, 7])
@pytest.mark.parametrize("share", [0.2, 1.0])
def test_swapped_columns_are_named(width, share):
    data = arms(38, width=width)
    order = np.arange(width)
    order[[0, 1]] = [1, 0]
    kind, _ = first(mapped(data, some(data, share), lambda part: part[:, order]))
    assert kind == "swapped_columns"


def test_columns_are_swapped_beyond_doubt_or_not_at_all():
    near = np.array([[0.95, 0.96, 0.1], [0.96, 0.95, 0.1], [0.1, 0.1, 0.9]])
    assert _assignment(near).tolist() == [0, 1, 2]
    clear = np.array([[0.6, 0.97, 0.1], [0.97, 0.6, 0.1], [0.1, 0.1, 0.9]])
    assert _assignment(clear).tolist() == [1, 0, 2]
    still = np.array([[0.2, 0.5], [0.5, 0.2]])
    assert _assignment(still).tolist() == [0, 1]


def test_joints_that_move_together_are_not_swapped():
    # One synergy drives all joints; they differ by a fifth.
    data = arms(39, width=7)
    commands, seen = parts(data)
    blend = 0.8 * np.ones((7, 7)) / 7 + 0.2 * np.eye(7)
    together = rebuilt(data, [c @ blend for c in commands], [s @ blend for s in seen])
    assert measure(together, SETTINGS).findings == ()


def test_an_arm_that_sags_or_falls_short_has_no_finding():
    data = arms(40)
    gains = np.array([0.95, 0.9, 0.8])
    weak = mapped(data, np.ones(60, dtype=bool), lambda part: part * gains - [0, 0, 0.02])
    assert measure(weak, SETTINGS).findings == ()


def test_jumps_by_a_turn_are_a_note_and_no_motion():
    data = arms(41, width=3)
    angles = 12.0 * data.observation
    asked = 12.0 * data.action
    wrap = np.pi
    wrapped = replace(
        data,
        observation=(angles + wrap) % (2 * wrap) - wrap,
        action=(asked + wrap) % (2 * wrap) - wrap,
    )
    motion = make_motion(wrapped)
    assert motion.wraps > 0
    inside = wrapped.episode[1:] == wrapped.episode[:-1]
    assert np.abs(np.diff(motion.observed, axis=0))[inside].max() < 2.2
    found = measure(wrapped, SETTINGS)
    assert found.findings == () and "whole turn" in found.notes[0]


def test_a_shift_at_rest_is_a_calibration():
    data = arms(42)
    shift = np.array([0.02, 0.0, 0.0])
    assert first(mapped(data, last_epoch(data), lambda part: part + shift))[0] == "calibration"
    everywhere = mapped(data, np.ones(60, dtype=bool), lambda part: part + shift)
    assert measure(everywhere, SETTINGS).findings == ()


def test_a_unit_comes_before_a_clock_and_both_are_seen():
    data = late(arms(43), 3.0, last_epoch(arms(43)))
    kinds = [d.kind for d in measure(
        mapped(data, some(data, 0.2), lambda part: 1000 * part), SETTINGS).findings]  # fmt: skip
    assert kinds[0] == "unit" and "clock" in kinds
