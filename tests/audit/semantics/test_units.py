"""Units: named wherever they differ, and only where they do."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms, last_epoch, late, parts, rebuilt, some

from genpolicy.audit.semantics import measure


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


def test_a_unit_comes_before_a_clock_and_both_are_seen():
    data = late(arms(43), 3.0, last_epoch(arms(43)))
    kinds = [d.kind for d in measure(
        mapped(data, some(data, 0.2), lambda part: 1000 * part), SETTINGS).findings]  # fmt: skip
    assert kinds[0] == "unit" and "clock" in kinds


@pytest.mark.parametrize(("scatter", "named"), [(3.0, True), (100.0, False)])
def test_a_hundredth_scatters_by_what_is_nearer_to_it_than_to_as_before(scatter, named):
    """Few episodes tell it to a factor of three; what stands elsewhere scatters as before."""
    data = arms(45)
    rng = np.random.default_rng(3)
    few = np.arange(60) < 18
    goal = np.where(few, 0.01, 1.0) + 0.02 * np.where(few, 0.01 * scatter, 1.0) * rng.normal(
        size=60
    )
    found = measure(replace(
        data, observation=np.hstack([data.observation, goal[data.episode][:, None]]),
        observation_names=(*data.observation_names, "goal"),
        observation_scale=np.full(4, 0.01), context={"goal": slice(3, 4)},
    ), SETTINGS)  # fmt: skip
    assert [(item.kind, item.variable) for item in found.findings] == [("unit", "goal")] * named
