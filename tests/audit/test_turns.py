"""Sides kept over a session show at every start, whatever the modes are called there."""

import numpy as np
import pytest

from genpolicy.audit.turns import pattern
from genpolicy.seeds import stream
from genpolicy.statistics.conditional import conditional_test

EPISODES = 120


def recorded(seed, *, starts, turns=8, dealt=False):
    """Places, modes with names of their own at each start, and starts, of 70 % of the episodes."""
    rng = stream(seed, "turns")
    side = np.arange(EPISODES) // turns % 2
    side = rng.permutation(side) if dealt else side
    start = rng.integers(0, starts, EPISODES)
    modes = 2 * start + (side ^ rng.integers(0, 2, starts)[start])
    chosen = np.flatnonzero(rng.random(EPISODES) < 0.7)
    return chosen.astype(float), modes[chosen], start[chosen]


@pytest.mark.parametrize("turns", [1, 8])
def test_a_side_per_session_is_seen_over_starts_whose_modes_share_no_name(turns):
    for seed in range(3):
        place, modes, start = recorded(seed, starts=6, turns=turns)
        found = pattern(place, modes, start, rng=stream(seed, "draws"), draws=1999)
        assert found.p_value <= 0.002
        # By name the modes nearby say next to nothing.
        assert np.mean(found.guessed == modes) > 0.75
        assert np.mean(found.by_nearest == modes) > 0.7


def test_of_three_ways_in_turn_each_is_guessed():
    """One number for each mode never speaks for the middle one."""
    rng = stream(5, "three")
    way = np.arange(EPISODES) // 8 % 3
    start = rng.integers(0, 4, EPISODES)
    modes = 3 * start + np.stack([rng.permutation(3) for _ in range(4)])[start, way]
    found = pattern(np.arange(EPISODES), modes, start, rng=stream(5, "draws"), draws=1999)
    assert found.p_value <= 0.001
    for one in range(3):
        assert np.mean((found.guessed == modes)[way == one]) > 0.6


def test_modes_that_are_dealt_have_no_pattern_and_are_not_guessed():
    p_values, right = [], []
    for seed in range(60):
        place, modes, start = recorded(seed, starts=6, dealt=True)
        found = pattern(place, modes, start, rng=stream(seed, "draws"), draws=199)
        p_values.append(found.p_value)
        right.append(np.mean(found.guessed == modes))
    # Exact: as many below a level as the level says, but for three standard errors.
    assert np.mean(np.array(p_values) <= 0.05) <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 60)
    # The numbers are found without the row, so that chance guesses as often as not.
    assert abs(np.mean(right) - 0.5) < 0.05


def test_the_order_of_the_rows_changes_nothing_but_their_order():
    place, modes, start = recorded(1, starts=3)
    found = pattern(place, modes, start, rng=stream(1, "draws"), draws=999)
    turned = pattern(place[::-1], modes[::-1], start[::-1], rng=stream(1, "draws"), draws=999)
    assert found.p_value == turned.p_value
    assert found.guessed.tolist() == turned.guessed[::-1].tolist()
    test = conditional_test(modes, found.guessed, start, rng=stream(1, "test"))
    assert test.effect > 0.3


def test_one_mode_everywhere_has_no_pattern():
    place, _, start = recorded(1, starts=3)
    found = pattern(place, start, start, rng=stream(1, "draws"), draws=99)
    assert found.p_value == 1.0 and set(found.guessed.tolist()) == {-1}
