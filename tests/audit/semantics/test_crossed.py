"""Crossed columns: only what a column says clearly, of enough rows."""

import numpy as np
from robots import chosen, flipped, robot, swapped

from genpolicy.audit.semantics.crossed import flipped as minus
from genpolicy.audit.semantics.crossed import swapped as exchanged
from genpolicy.audit.semantics.following import column_correlations, following
from genpolicy.audit.semantics.motion import make_motion


def read(data):
    motion = make_motion(data)
    found = following(motion, data.period_s, 12)
    pairs = exchanged(found, column_correlations(found, motion.starts))
    return minus(found, motion.directional), pairs


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
