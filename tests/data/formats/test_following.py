"""Who follows whom, and how: shares of motion, gains, and what a minority of faults may do."""

import numpy as np
import pytest

from genpolicy.data.formats.following import changes, levels, places, varies

EPISODE = np.repeat(np.arange(8), 50)


def walk(seed, width=3, rows=400):
    """Paths that begin anew with every episode. Shape (rows, width)."""
    steps = np.random.default_rng(seed).normal(0, 0.05, (rows, width))
    return np.concatenate([np.cumsum(part, axis=0) for part in np.split(steps, rows // 50)])


def steps_of(path):
    """Change from each row to the next, 0 at the end of an episode."""
    change = np.diff(path, axis=0, append=path[-1:])
    change[np.flatnonzero(np.diff(EPISODE, append=99))] = 0.0
    return change


@pytest.mark.parametrize("lag", [0, 3, 8])
def test_a_place_is_followed_behind_any_lag(lag):
    path = walk(1)
    told = np.concatenate([np.roll(part, -lag, axis=0) for part in np.split(path, 8)])
    found = places(path, told, EPISODE, gain=1.0)
    assert np.diag(found.explained).min() > 0.7
    assert (found.explained - np.diag(np.diag(found.explained))).max() < 0.5


@pytest.mark.parametrize("gain", [1.0, 0.05, -3.0])
def test_the_gain_of_a_change_is_measured(gain):
    path = walk(2)
    found = changes(path, steps_of(path) / gain, EPISODE)
    np.testing.assert_allclose(np.diag(found.gain), gain, rtol=1e-6)
    np.testing.assert_allclose(np.diag(found.explained), 1.0, atol=1e-9)
    assert places(path, steps_of(path) / gain, EPISODE, gain=1.0).explained.max() < 0.75


def test_a_constant_velocity_to_either_side_is_a_change():
    side = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 8), 50)[:, None]
    path = side * np.tile(np.arange(50), 8)[:, None] * 0.01
    found = changes(path, side, EPISODE)
    assert found.explained[0, 0] == pytest.approx(1.0)
    assert found.beyond[0, 0]
    assert found.gain[0, 0] == pytest.approx(0.01)
    assert not places(path, side, EPISODE).explained[0, 0] > 0.1


@pytest.mark.parametrize("fault", [lambda a: -a, lambda a: a / 100, lambda a: a[:, ::-1]])
def test_a_fault_in_a_third_of_the_episodes_decides_nothing(fault):
    path = walk(3, width=2)
    told = steps_of(path)
    bad = EPISODE % 3 == 0
    told[bad] = fault(told[bad])
    found = changes(path, told, EPISODE)
    np.testing.assert_allclose(np.diag(found.gain), 1.0, rtol=1e-6)
    assert np.diag(found.explained).min() > 0.99


def test_the_order_of_the_episodes_changes_nothing_of_a_share():
    path = walk(4)
    told = steps_of(path)
    order = np.random.default_rng(1).permutation(8)
    rows = np.concatenate([np.flatnonzero(e == EPISODE) for e in order])
    one, other = (
        changes(path, told, EPISODE),
        changes(path[rows], told[rows], EPISODE),
    )
    np.testing.assert_allclose(one.explained, other.explained)
    np.testing.assert_allclose(one.gain, other.gain)


def test_what_all_episodes_do_alike_is_no_following():
    """Reaches that are all one: any two numbers follow each other, and neither commands."""
    rise = 1.0 / (1.0 + np.exp(-(np.arange(50) - 25) / 6.0))
    noise = np.random.default_rng(5).normal(0, 0.04, (400, 2))
    path = np.tile(rise, 8)[:, None] + noise[:, :1]
    other = np.tile(3.0 * rise, 8)[:, None] + 3.0 * noise[:, 1:]
    found = places(path, other, EPISODE)
    assert found.explained[0, 0] > 0.8
    assert not found.beyond[0, 0]


def test_strangers_follow_nobody():
    hits = [
        max(places(walk(s), walk(s + 500), EPISODE, gain=1.0).explained.max(),
            changes(walk(s), walk(s + 500), EPISODE).explained.max())
        for s in range(40)
    ]  # fmt: skip
    assert sum(hit >= 0.5 for hit in hits) <= 2


def test_a_held_arm_tells_by_where_it_is():
    held = np.repeat(np.random.default_rng(2).normal(0, 1, (8, 2)), 50, axis=0)
    jitter = np.random.default_rng(3).normal(0, 0.01, (2, 400, 2))
    found = levels(held + jitter[0], held + jitter[1], EPISODE)
    assert np.diag(found).min() > 0.99
    assert max(found[0, 1], found[1, 0]) < 0.5
    assert places(held + jitter[0], held + jitter[1], EPISODE, gain=1.0).explained.max() < 0.5


def test_too_little_says_nothing():
    few = np.zeros((5, 1))
    assert changes(few, few, np.zeros(5, dtype=int)).explained[0, 0] == -np.inf
    assert levels(few, few, np.zeros(5, dtype=int))[0, 0] == -np.inf
    constant = np.full((400, 1), 0.3)
    assert changes(walk(6), constant, EPISODE).explained.max() < 0.5


def test_a_column_of_rounding_does_not_vary():
    rounding = 0.2 + 1e-17 * np.arange(100.0)
    assert varies(np.stack([rounding, np.arange(100.0)], axis=1)).tolist() == [False, True]
    assert varies(np.zeros((0, 2))).tolist() == [False, False]


def test_a_damaged_number_stops_nothing():
    path = walk(7)
    path[17, 0] = 1e300
    found = changes(path, steps_of(walk(7)), EPISODE)
    assert found.explained[1, 1] > 0.99
