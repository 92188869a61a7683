"""Clusters that the observation itself tells apart are no modes."""

import numpy as np
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.resolution import resolved_by_observation
from genpolicy.seeds import stream

SIDES = Clustering(np.where(np.arange(20) < 10, 0, 1), 0.1, (0, 10))


def standing(course_m, noise_m):
    """Twenty episodes about one place, of which ten came to it on another course."""
    data = canonical(planar(episodes=60)[0])
    rng = stream(41, "course")
    rows = np.flatnonzero(data.index == 1)[:20]
    place = rng.normal(0, 0.008, (20, 2))
    step = np.array([0.008, 0.0]) + np.where(np.arange(20) < 10, 1, -1)[:, None] * course_m
    data.observation[rows, :2] = place
    data.observation[rows - 1, :2] = place - step + rng.normal(0, noise_m, (20, 2))
    return data, Neighbourhood(int(rows[-1]), rows[:-1], np.zeros(19))


def test_a_goal_that_shows_in_the_last_step_is_observed_and_one_that_does_not_is_hidden():
    shows, item = standing(np.array([0.0, 0.004]), 0.0005)
    assert resolved_by_observation(shows, SETTINGS, item, SIDES)
    # One observation alone does not show it: the places are the same.
    alone = SETTINGS.model_copy(update={"observation_horizon": 1})
    assert not resolved_by_observation(shows, alone, item, SIDES)
    hidden, item = standing(np.zeros(2), 0.0005)
    assert not resolved_by_observation(hidden, SETTINGS, item, SIDES)


def test_a_course_that_differs_along_no_axis_is_seen_and_a_hair_is_none():
    slanted, item = standing(np.array([0.003, 0.003]), 0.0015)
    assert resolved_by_observation(slanted, SETTINGS, item, SIDES)
    hair, item = standing(np.array([0.0, 0.0004]), 0.00005)
    assert not resolved_by_observation(hair, SETTINGS, item, SIDES)


def test_the_place_decides_along_any_line():
    data = canonical(planar(episodes=60)[0])
    rng = stream(40, "line")
    rows = np.flatnonzero(data.index == 0)[:20]
    inside = np.arange(20) < 10
    place = np.where(inside, 0.008, -0.008)[:, None] * np.ones(2)
    place = place + np.array([1.0, -1.0]) * rng.normal(0, 0.012, (20, 1))
    for back in range(2):
        data.observation[rows + back, :2] = place
    clustering = Clustering(np.where(inside, 0, 1), 0.1, (0, 10))
    item = Neighbourhood(int(rows[-1]), rows[:-1], np.zeros(19))
    apart = [np.abs(np.median(place[inside, k]) - np.median(place[~inside, k])) for k in (0, 1)]
    assert max(apart) < 0.03
    assert resolved_by_observation(data, SETTINGS, item, clustering)
    assert not resolved_by_observation(
        data, SETTINGS, item, Clustering(np.arange(20) % 2, 0.1, (0, 1))
    )
