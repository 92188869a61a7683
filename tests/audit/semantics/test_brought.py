"""What people bring: five robots, each as it is and with one known change.

Every finding of data semantics is a claim about somebody's recording. A change that spoils it must
be named, a change that does not must stay unsaid.
"""

import numpy as np
import pytest
from arms import SETTINGS, arms, build
from robots import (
    EPISODES,
    ROBOTS,
    chosen,
    constant,
    flipped,
    glued_to_itself,
    lagged,
    robot,
    scaled,
    swapped,
    trembling,
    waiting,
)

from genpolicy.audit.semantics import measure
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import clopper_pearson

NAMES = tuple(ROBOTS)
HEALTHY_SEEDS = 10
# A column that moves, and another; the humanoid's first seven hardly do.
MOVING = {name: (9, 11) if name == "humanoid" else (0, 1) for name in NAMES}


def kinds(data):
    return [finding.kind for finding in measure(data, SETTINGS).findings]


def lag_of(name):
    return int(ROBOTS[name].lag_rows[0])


def test_recordings_as_they_are_have_no_finding():
    found = [
        (name, seed, kinds(robot(name, 900 + seed)))
        for name in NAMES for seed in range(HEALTHY_SEEDS)
    ]  # fmt: skip
    false = [item for item in found if item[2]]
    assert len(false) <= 1, false
    assert clopper_pearson(len(false), len(found), 0.95)[1] <= 0.1


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("where", ["action", "observation", "both"])
@pytest.mark.parametrize(("factor", "share"), [(512.0, 0.33), (1 / 512, 0.33), (0.01, 0.4)])
def test_a_part_of_the_episodes_in_another_unit_is_named(name, where, factor, share):
    data = robot(name, 1)
    hit = chosen(data, share)
    found = measure(scaled(data, factor, where, hit), SETTINGS).findings
    assert {finding.kind for finding in found} == {"unit"}
    assert found[0].measured == pytest.approx(max(factor, 1 / factor), rel=0.5)
    assert found[0].where.startswith(str(data.episodes.uuid[hit][0]))
    assert f"and {hit.sum() - 3} more" in found[0].where


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("rows", "share"), [(3, 0.33), (3, 0.5), (6, 0.5)])
def test_a_lag_of_half_of_the_episodes_is_named(name, rows, share):
    data = robot(name, 1)
    semantics = measure(lagged(data, rows, chosen(data, share)), SETTINGS)
    clock = semantics.findings[0]
    assert (clock.kind, len(semantics.findings)) == ("clock", 1)
    assert clock.measured == pytest.approx(rows * data.period_s, rel=0.2)
    hit = chosen(data, share)
    shifted = semantics.shift_rows != 0
    wrong = min(np.count_nonzero(shifted != hit), np.count_nonzero(shifted != ~hit))
    assert wrong <= 0.05 * EPISODES


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_a_flipped_joint_is_named_with_its_episodes(name, share):
    data, column = robot(name, 1), MOVING[name][0]
    hit = chosen(data, share)
    found = measure(flipped(data, column, hit), SETTINGS).findings
    assert {finding.kind for finding in found} == {"frame"}
    assert found[0].variable == data.observation_names[column]
    assert found[0].where.startswith(f"{hit.sum()} episodes ({data.episodes.uuid[hit][0]}")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("share", [0.1, 0.25])
def test_two_swapped_joints_are_named(name, share):
    data = robot(name, 1)
    hit = chosen(data, share)
    found = measure(swapped(data, MOVING[name], hit), SETTINGS).findings
    assert found[0].kind == "swapped_columns"
    assert {finding.kind for finding in found} <= {"swapped_columns", "frame"}
    first, second = (data.observation_names[k] for k in MOVING[name])
    assert f"{first} answers the command of {second}" in found[0].action
    assert int(found[0].where.split()[0]) >= 0.8 * hit.sum()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("where", ["action", "observation", "both"])
@pytest.mark.parametrize("share", [1.0, 0.33])
@pytest.mark.parametrize("place", ["moving", "still"])
def test_a_tremor_is_no_unit(name, where, share, place):
    data = robot(name, 1)
    column = MOVING[name][0] if place == "moving" else 1 if name == "planar" else 2
    size = 0.3 * float(np.std(data.action[:, MOVING[name][0]]))
    shaken = trembling(
        data, column, size, chosen(data, share), where=where, lag_rows=lag_of(name)
    )  # fmt: skip
    assert kinds(shaken) == []


@pytest.mark.parametrize("name", ["arm", "humanoid", "two_arms", "tool"])
@pytest.mark.parametrize("jitter", [0.0, 1e-9, 1e-6, 1e-4])
def test_a_constant_has_no_unit(name, jitter):
    assert kinds(constant(robot(name, 1), 2, jitter)) == []


@pytest.mark.parametrize("factor", [180 / np.pi, np.pi / 180])
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_one_joint_in_degrees_is_still_a_unit(factor, share):
    data = robot("arm", 1)
    hit = chosen(data, share)
    action = data.action.copy()
    action[:, 4] *= np.where(hit, factor, 1.0)[data.episode]
    found = measure(type(data)(**{**data.__dict__, "action": action}), SETTINGS).findings
    assert {finding.kind for finding in found} == {"unit"}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("rows", [(15, 60), (150, 300)])
@pytest.mark.parametrize("same", [True, False])
def test_episodes_that_wait_at_first_are_no_copies(name, rows, same):
    data = waiting(robot(name, 1), rows, same=same, lag_rows=lag_of(name))
    assert kinds(data) == []


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("copies", "share", "noise"), [(1, 0.1, 0.0), (2, 0.4, 0.0), (1, 0.3, 1e-4)]
)
def test_episodes_glued_to_themselves_without_their_rests_are_named(name, copies, share, noise):
    data = robot(name, 1)
    hit = chosen(data, share)
    found = measure(glued_to_itself(data, hit, copies=copies, noise=noise), SETTINGS).findings
    assert {finding.kind for finding in found} == {"glued"}
    assert len(found) == 1
    assert noise or f"hold the same rows twice ({hit.sum()})" in found[0].action
    # With noise a copy without its rests is seen by the jump to it, where there is one.
    least = 0.6 if noise else 1.0
    assert least * hit.sum() <= int(found[0].action.split()[0]) <= hit.sum()


def planned(goals, noise, wait):
    """A planner's ways from one place to a few goals, after a wait."""
    rng = stream(3, "planned")
    commands, seen = [], []
    for _ in range(60):
        n, goal = int(rng.integers(50, 80)), rng.integers(goals)
        s = np.linspace(0, 1, n)[:, None]
        s = 10 * s**3 - 15 * s**4 + 6 * s**5
        way = s * (np.array([np.cos(goal), np.sin(goal)]) + 0.05 * rng.normal(size=2))
        way = way + np.sin(np.pi * s) * 0.1 * rng.normal(size=2) + noise * rng.normal(size=(n, 2))
        rest = np.zeros((int(rng.integers(*wait)), 2))
        answer = np.vstack([np.repeat(way[:1], 3, axis=0), way])[:n]
        commands.append(np.vstack([rest, way]))
        seen.append(np.vstack([rest, answer]))
    return build(commands, seen, epochs=1, period_s=0.1)


@pytest.mark.parametrize("goals", [1, 2, 4])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("wait", [(20, 60), (60, 61), (100, 200)])
def test_a_planner_that_waits_at_one_place_does_not_copy_itself(goals, noise, wait):
    assert kinds(planned(goals, noise, wait)) == []


@pytest.mark.parametrize("cut", ["nothing", "wait", "end"])
def test_copies_of_episodes_that_wait_are_still_found(cut):
    data = waiting(arms(3, noise=0.0), (30, 60))
    rows = [np.flatnonzero(data.episode == k) for k in range(60)]
    for number in range(6):
        copy = rows[number]
        if cut == "wait":
            copy = copy[25:]
        if cut == "end":
            copy = copy[: int(0.75 * len(copy))]
        rows.append(copy)
    copied = build([data.action[r] for r in rows], [data.observation[r] for r in rows],
                   epochs=2, period_s=data.period_s)  # fmt: skip
    found = measure(copied, SETTINGS).findings
    assert [finding.kind for finding in found] == ["duplicate"]
    assert "6 of 66 episodes are copies" in found[0].action
