"""How columns follow, by themselves: sign, lag, and what stands."""

import numpy as np
import pytest
from arms import SETTINGS, arms, build, late, parts
from robots import chosen, flipped, lagged, robot, swapped

from genpolicy.audit.semantics import measure
from genpolicy.audit.semantics.following import column_correlations, following
from genpolicy.audit.semantics.motion import make_motion


def of(data):
    motion = make_motion(data)
    return following(motion, data.period_s, 12), motion


def test_the_lag_of_each_episode_is_its_own():
    data = robot("arm", 2)
    hit = chosen(data, 0.5)
    found, _ = of(lagged(data, 5, hit))
    assert np.median(found.common_lag[~hit]) == pytest.approx(3, abs=1)
    gap = np.median(found.common_lag[hit]) - np.median(found.common_lag[~hit])
    assert gap == pytest.approx(5, abs=1)


def test_a_flipped_column_follows_the_negative_and_the_others_do_not():
    data = robot("two_arms", 2)
    hit = chosen(data, 0.5)
    found, _ = of(flipped(data, 3, hit))
    assert np.all(found.negative[hit, 3] > found.positive[hit, 3] + 0.1)
    assert np.all(found.positive[~hit, 3] > found.negative[~hit, 3] + 0.1)
    assert np.mean(found.follows[:, :7]) > 0.9


def test_a_column_that_stands_follows_nothing():
    data = robot("arm", 2)
    data.action[:, 1] = 0.3
    found, _ = of(data)
    assert not found.follows[:, 1].any() and np.all(found.asked[:, 1] == 0.0)


def test_swapped_columns_answer_each_other():
    data = robot("arm", 2)
    hit = chosen(data, 0.4)
    found, motion = of(swapped(data, (0, 5), hit))
    table = column_correlations(found, motion.starts)
    assert np.all(table[hit, 0, 5] > 0.9) and np.all(table[hit, 5, 0] > 0.9)
    assert np.median(table[~hit, 0, 0]) > 0.9


@pytest.mark.parametrize("place", [0, 1, -1])
@pytest.mark.parametrize("rows", [3, 5, 12])
def test_an_episode_shorter_than_its_lag_correlates_with_nothing(place, rows):
    """Wherever it stands; at the begin its rows were taken for those of the whole table."""
    commands, seen = parts(late(arms(41, width=2), 6, np.ones(60, dtype=bool)))
    commands[place], seen[place] = commands[place][:rows], seen[place][:rows]
    data = build(commands, seen, epochs=1, period_s=0.05)
    motion = make_motion(data)
    found = following(motion, data.period_s, SETTINGS.maximum_lag_rows)
    assert np.all(column_correlations(found, motion.starts)[place] == 0.0) or rows == 12
    measure(data, SETTINGS)
