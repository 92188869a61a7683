"""Factors in a part of the episodes: named where they are one factor, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms, build, parts, rebuilt, some

from genpolicy.audit.forms import Forms
from genpolicy.audit.semantics import measure

PART = 1.0 / 3.0


def scaled(part, factor):
    """The motion from the first row on, by another factor."""
    return part[:1] + factor * (part - part[:1])


def gained(data, chosen, factor, *, told=False):
    """What is observed, or told, goes by another factor in some episodes."""
    commands, seen = parts(data)
    changed = commands if told else seen
    for number in np.flatnonzero(chosen):
        changed[number] = scaled(changed[number], factor)
    return rebuilt(data, commands, seen)


def found(data):
    findings = measure(data, SETTINGS).findings
    return [item for item in findings if item.question == "gain_epoch_factor"]


def one_epoch(seed, **fields):
    """A healthy arm of which no epoch is recorded."""
    return arms(seed, epochs=1, **fields)


@pytest.mark.parametrize("told", [False, True])
@pytest.mark.parametrize("factor", [1.5, 1 / 1.5, 2.54, 1 / 2.54])
def test_commands_of_another_scale_in_a_part_are_a_unit(factor, told):
    """Red before: the motion differs by less than any arm's, and all of it was called modes."""
    data = one_epoch(51)
    chosen = some(data, PART)
    (item,) = found(gained(data, chosen, factor, told=told))
    assert (item.kind, item.variable) == ("unit", "position")
    assert item.measured == pytest.approx(max(factor, 1 / factor), rel=0.1)
    assert f"In {np.count_nonzero(chosen)} of 60 episodes (ep" in item.action
    assert (" more of what" in item.action) == ((factor > 1) != told)


@pytest.mark.parametrize("speed", [0.1, 0.4])
@pytest.mark.parametrize("widths", [(0.02, 0.05), (0.01, 0.05), (0.0, 0.045)])
def test_a_finger_that_is_stopped_by_what_it_holds_is_none(widths, speed):
    """Of two widths that nobody recorded, independent of the way: most data has such a column."""
    data = one_epoch(52)
    commands, seen = parts(data)
    wide = some(data, 0.5)
    for number, (command, part) in enumerate(zip(commands, seen, strict=True)):
        asked, opening = np.full(len(command), 0.08), np.full(len(command), 0.08)
        asked[int(0.3 * len(command)) : int(0.8 * len(command))] = 0.0
        for row in range(1, len(command)):
            goal = max(asked[row - 1], widths[int(wide[number])])
            step = np.clip(goal - opening[row - 1], -speed * 0.05, speed * 0.05)
            opening[row] = opening[row - 1] + step
        commands[number] = np.column_stack([command, asked])
        seen[number] = np.column_stack([part, opening])
    assert found(build(commands, seen, epochs=1, period_s=0.05)) == []


def test_one_joint_of_another_scale_is_not_told_from_one_that_is_stopped():
    data = one_epoch(52, width=7)
    assert found(gained(data, some(data, PART), np.where(np.arange(7) == 4, 0.6, 1.0))) == []


def test_rates_are_not_asked_for_a_controller_may_clip_them():
    healthy = one_epoch(59)
    data = gained(healthy, some(healthy, PART), 1.5, told=True)
    assert found(data)
    steps = np.vstack([np.diff(part, axis=0, prepend=part[:1]) for part in parts(data)[0]])
    forms = Forms(np.ones(3, dtype=bool), np.ones(3), np.zeros(3), np.arange(3))
    assert found(replace(data, action=steps, forms=forms)) == []


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_what_goes_alike_everywhere_is_none(share):
    data = one_epoch(53)
    assert found(gained(data, some(data, share), 0.6)) == []


def test_what_a_faster_arm_falls_short_by_is_none():
    data = one_epoch(54)
    assert found(gained(data, some(data, PART), 1 / 1.2)) == []


def _to_the_right(data):
    return np.array([part[-1, 0] > part[0, 0] for part in parts(data)[0]])


def _shorter(data):
    lasted = np.array([len(part) for part in parts(data)[0]])
    return lasted < np.median(lasted)


@pytest.mark.parametrize("chosen", [_to_the_right, _shorter])
def test_a_factor_that_the_way_or_the_pace_tells_is_a_spring(chosen):
    """An arm that is softer on one side, or falls short where it is fast, has one unit."""
    data = one_epoch(55)
    assert found(gained(data, chosen(data), 0.6)) == []
    assert found(gained(data, np.random.default_rng(1).permutation(chosen(data)), 0.6))


def test_a_factor_that_what_is_carried_tells_is_a_load():
    data = one_epoch(56)
    chosen = some(data, PART)
    heavy = gained(data, chosen, 0.6)
    names = np.where(chosen, "heavy", "light")
    assert found(replace(heavy, episodes=replace(heavy.episodes, object=names))) == []
    other = np.where(some(data, 0.5, seed=3), "heavy", "light")
    assert found(replace(heavy, episodes=replace(heavy.episodes, object=other)))


def test_a_factor_in_one_half_of_the_way_is_something_that_was_met():
    data = one_epoch(57)
    commands, seen = parts(data)
    for number in np.flatnonzero(some(data, PART)):
        part = seen[number]
        middle = int(np.argmin(np.abs(part - (part[0] + part[-1]) / 2).sum(axis=1)))
        part[middle:] = scaled(part[middle:], 0.4)
    assert found(rebuilt(data, commands, seen)) == []


def test_a_few_episodes_and_a_scatter_of_factors_are_none():
    data = one_epoch(58)
    few = np.arange(60) < 3
    assert found(gained(data, few, 0.6)) == []
    commands, seen = parts(data)
    factors = np.random.default_rng(2).uniform(0.6, 1.0, 60)
    seen = [scaled(part, factor) for part, factor in zip(seen, factors, strict=True)]
    assert found(rebuilt(data, commands, seen)) == []
