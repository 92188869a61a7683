"""Crossed columns: only what a column says clearly, of enough rows."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, build
from robots import chosen, flipped, robot, swapped

from genpolicy.audit.semantics import crossed
from genpolicy.audit.semantics.crossed import crossed_findings
from genpolicy.audit.semantics.crossed import flipped as minus
from genpolicy.audit.semantics.crossed import swapped as exchanged
from genpolicy.audit.semantics.following import Following, column_correlations, following
from genpolicy.audit.semantics.motion import make_motion


def read(data):
    motion = make_motion(data)
    found = following(motion, data.period_s, 12)
    everyone = np.ones(len(data.episodes), dtype=bool)
    pairs = exchanged(found, column_correlations(found, motion.starts), everyone)
    return minus(found, motion.directional, 12), pairs


def test_the_columns_and_episodes_are_those_that_were_crossed():
    data = robot("humanoid", 4)
    hit = chosen(data, 0.3)
    signs, pairs = read(flipped(data, 12, hit))
    assert np.array_equal(signs[:, 12], hit) and signs.sum() == hit.sum() and not pairs.any()
    signs, pairs = read(swapped(data, (9, 20), hit))
    # The second is a finger, which is stopped early in some episodes.
    assert np.mean(pairs[hit, 9, 20]) > 0.6
    assert not pairs[~hit].any() and not signs[~hit].any()


def test_a_joint_that_is_dragged_along_is_not_flipped():
    # Held still by its motor, it gives way a little against a neighbour's command.
    data = robot("arm", 4)
    hit = chosen(data, 0.2)
    rows = hit[data.episode]
    data.observation[rows, 2] = data.observation[0, 2] - 0.02 * data.action[rows, 2]
    assert not read(data)[0].any()


def alike(seed=0, *, episodes=100, noise=1e-3):
    """Four joints that start and stop together, as a planner moves them: short, and much alike."""
    rng = np.random.default_rng(seed)
    commands, seen = [], []
    for _ in range(episodes):
        n = int(rng.integers(40, 60))
        s = np.clip(np.linspace(-0.1, 1.1, n), 0, 1)[:, None]
        goal = rng.uniform(0.4, 1.0, 4) * np.array([1.0, 1.0, 1.0, -1.0])
        bend = 0.05 * rng.normal(size=4) * np.sin(np.pi * s)
        path = goal * (10 * s**3 - 15 * s**4 + 6 * s**5) + bend
        commands.append(path)
        trailing = path[np.maximum(np.arange(n) - 2, 0)]
        seen.append(trailing + noise * rng.normal(size=path.shape))
    return build(commands, seen, epochs=1, period_s=0.05)


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.6, 0.85])
@pytest.mark.parametrize("seed", range(3))
def test_joints_that_move_alike_are_found_swapped_by_all_episodes_together(seed, share):
    data = alike(seed)
    hit = chosen(data, share, seed)
    pairs = read(swapped(data, (0, 2), hit))[1]
    # Where both go equally far their commands are nearly one.
    assert np.mean(pairs[hit, 0, 2]) >= 0.5
    pairs[:, [0, 2], [2, 0]] &= ~hit[:, None]
    assert not pairs.any()


@pytest.mark.parametrize("seed", range(6))
def test_joints_that_move_alike_are_not_swapped_by_chance(seed):
    for noise in (1e-4, 1e-3, 1e-2):
        signs, pairs = read(alike(seed, noise=noise))
        assert not pairs.any() and not signs.any()


def read_as(positive, **more):
    """A hundred episodes of four columns, each read as it is said, with ten rows of its own."""
    shape = (100, 4)
    plain = {
        "negative": np.zeros(shape), "asked": np.ones(shape), "seen": np.ones(shape),
        "slow": np.ones(shape, dtype=bool), "lag": np.full(shape, 2),
        "independent": np.full(100, 10.0),
        "moves": (np.zeros(shape), np.zeros(shape)),
    }  # fmt: skip
    return Following(positive=np.full(shape, positive), **{**plain, **more})


FIFTH = np.arange(100) < 20
EVERYONE = np.ones(100, dtype=bool)
# In a fifth of the episodes columns move three times as much as their commands ask.
ODD = np.where(FIFTH[:, None], 3.0, 1.0) * np.ones((100, 4))


def crossing(value, pairs=((1, 2),), hit=FIFTH):
    found = np.zeros((100, 4, 4))
    for a, b in pairs:
        found[hit, a, b] = found[hit, b, a] = value
    return found


def test_a_swap_needs_both_ways_a_bad_fit_and_one_partner():
    odd = read_as(0.9, seen=ODD)
    found = exchanged(odd, crossing(0.99), EVERYONE)
    assert found[FIFTH, 1, 2].all() and found.sum() == 2 * FIFTH.sum()
    assert not exchanged(odd, crossing(0.99), ~EVERYONE).any()
    one_way = crossing(0.99)
    one_way[:, 2, 1] *= 0.9
    assert not exchanged(odd, one_way, EVERYONE).any()
    # As large and as near as always to its own command: a twin of the other, no swap.
    assert not exchanged(read_as(0.9), crossing(0.955), EVERYONE).any()
    assert exchanged(odd, crossing(0.955), EVERYONE)[FIFTH, 1, 2].all()
    # What answers every command is read wrong.
    ring = ((0, 1), (1, 2), (2, 0))
    assert not exchanged(odd, crossing(0.99, ring), EVERYONE).any()


def test_one_of_both_fits_its_command_badly_and_those_not_asked_count_for_nothing():
    one = ODD.copy()
    one[:, [0, 2, 3]] = 1.0
    assert exchanged(read_as(0.9, seen=one), crossing(0.99), EVERYONE)[FIFTH, 1, 2].all()
    # Seven of a hundred prove nothing, seven of the sixteen that can be read do.
    few = np.arange(100) < 7
    odd = read_as(0.9, seen=np.where(few[:, None], 4.0, 1.0) * np.ones((100, 4)))
    weak = crossing(0.93, hit=few)
    assert not exchanged(odd, weak, EVERYONE).any()
    assert exchanged(odd, weak, np.arange(100) < 16)[few, 1, 2].all()
    unread = replace(odd, positive=np.where(np.arange(100)[:, None] < 16, 0.9, np.nan))
    assert exchanged(unread, weak, EVERYONE)[few, 1, 2].all()


def test_two_episodes_of_which_neither_is_clear_are_a_mishap():
    odd = read_as(0.9, seen=ODD)
    assert not exchanged(odd, crossing(0.955, hit=np.arange(100) < 2), EVERYONE).any()
    assert exchanged(odd, crossing(0.955), EVERYONE)[FIFTH, 1, 2].all()


def test_what_goes_to_and_fro_is_late_and_not_flipped():
    negative = np.zeros((100, 4))
    negative[FIFTH, 1] = 0.99
    odd = read_as(0.9, negative=negative)
    assert minus(odd, np.zeros(4, dtype=bool), 12)[FIFTH, 1].all()
    half_a_round = np.full((100, 4), 2)
    half_a_round[FIFTH] = -9
    late = replace(odd, lag=half_a_round)
    assert not minus(late, np.zeros(4, dtype=bool), 12).any()


def test_nobody_is_swapped_behind_a_lag_that_is_none(monkeypatch):
    data = alike()
    motion = make_motion(data)
    motion = replace(motion, commanded=motion.commanded[:, :4])
    behind = np.where(FIFTH, -9, 2)[:, None] * np.ones((100, 4), dtype=np.int64)
    monkeypatch.setattr(crossed, "column_correlations", lambda found, starts: crossing(0.99))
    for lag, expected in ((np.full((100, 4), 2), {"swapped_columns"}), (behind, set())):
        found = crossed_findings(data, motion, read_as(0.9, seen=ODD, lag=lag), EVERYONE, SETTINGS)
        assert {finding.kind for finding in found[0]} == expected
