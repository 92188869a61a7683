"""Frames and columns: what is turned, mirrored or swapped."""

import numpy as np
import pytest
from arms import SETTINGS, arms, last_epoch, parts, rebuilt, some

from genpolicy.audit.semantics import measure
from genpolicy.audit.semantics.frames import _assignment


def mapped(data, chosen, change):
    commands, seen = parts(data)
    seen = [change(part) if chosen[k] else part for k, part in enumerate(seen)]
    return rebuilt(data, commands, seen)


def first(data, settings=SETTINGS):
    findings = measure(data, settings).findings
    return (findings[0].kind, findings[0].where) if findings else ("", "")


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


@pytest.mark.parametrize("places", [[-1], [0], [-2, -1]])
def test_an_episode_too_short_for_a_displacement_says_nothing(places):
    """Wherever it stands, the last included; who follows badly beside it is still found."""
    data = arms(40, width=3)
    chosen = some(data, 0.2)
    commands, seen = parts(mapped(data, chosen, lambda part: part @ turned(60).T))
    for place in places:
        commands[place], seen[place] = commands[place][:6], seen[place][:6]
    kind, where = first(rebuilt(data, commands, seen))
    assert kind == "frame" and "episodes (ep" in where


def test_a_last_episode_that_is_too_short_ends_no_audit():
    """It has no displacements: what is counted by episode is counted for all of them."""
    data = arms(39)
    commands, seen = parts(data)
    commands[-1], seen[-1] = commands[-1][:8], seen[-1][:8]
    assert measure(rebuilt(data, commands, seen), SETTINGS).findings == ()
