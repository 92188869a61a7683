"""Clusters that the observation itself tells apart are no modes."""

from dataclasses import replace

import numpy as np
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.resolution import DRAWS, Told, credible, resolved_by_observation
from genpolicy.seeds import stream

SIDES = Clustering(np.where(np.arange(20) < 10, 0, 1), 0.1, (0, 10))


def resolved(*asked):
    """Whether anything tells the clusters, be it by chance."""
    told = resolved_by_observation(*asked)
    return told.together or bool(told.columns)


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
    assert resolved(shows, SETTINGS, item, SIDES)
    # One observation alone does not show it: the places are the same.
    alone = SETTINGS.model_copy(update={"observation_horizon": 1})
    assert not resolved(shows, alone, item, SIDES)
    hidden, item = standing(np.zeros(2), 0.0005)
    assert not resolved(hidden, SETTINGS, item, SIDES)


def test_a_course_that_differs_along_no_axis_is_seen_and_a_hair_is_none():
    slanted, item = standing(np.array([0.003, 0.003]), 0.0015)
    assert resolved(slanted, SETTINGS, item, SIDES)
    hair, item = standing(np.array([0.0, 0.0004]), 0.00005)
    assert not resolved(hair, SETTINGS, item, SIDES)


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
    assert resolved(data, SETTINGS, item, clustering)
    assert not resolved(data, SETTINGS, item, Clustering(np.arange(20) % 2, 0.1, (0, 1)))


def noisy(width, *, tells=None, situations=30, members=14):
    """Situations of many components that say nothing, and maybe of one that tells; each its own."""
    data = canonical(planar(episodes=80)[0])
    rng = stream(43, "noise", width)
    found = []
    observation = rng.normal(0.0, 3.0, (len(data.index), width))
    for number in range(situations):
        rows = np.flatnonzero(data.index == 5 + number % 4)
        rows = rng.choice(rows, members, replace=False)
        labels = (np.arange(members) < 5).astype(np.int64)
        if tells is not None:
            observation[rows, tells] = np.where(labels == 1, 2.0, -2.0)
        told = resolved_by_observation(
            replace(
                data, observation=observation, observation_scale=np.ones(width),
                observation_position=slice(0, 0),
            ),
            SETTINGS, Neighbourhood(int(rows[-1]), rows[:-1], np.zeros(members - 1)),
            Clustering(labels, 0.1, (5, 0)),
        )  # fmt: skip
        found.append((number, told))
    return found


def test_of_many_components_that_say_nothing_none_is_believed():
    for width in (4, 60):
        told = noisy(width)
        assert credible(told, 2 * width) == frozenset()
    # By luck some tell the clusters in most of the situations, each time others.
    lucky = [item.columns for _, item in told]
    assert sum(map(bool, lucky)) > 6 and len(frozenset().union(*lucky)) > 5
    assert all(len(item.chance) == DRAWS for _, item in told)


def test_one_that_tells_is_believed_among_many():
    assert credible(noisy(60, tells=7), 120) == {7}
    assert credible(noisy(4, tells=2), 8) == {2}


def test_situations_of_one_episode_count_once():
    none = (frozenset(),) * DRAWS
    one = [(0, Told(False, frozenset({3}), none))] * 20
    assert credible(one, 40) == frozenset()
    assert credible([(k, told) for k, (_, told) in enumerate(one[:2])], 40) == {3}
    often = (frozenset({3}), *none[1:])
    lucky = [(k, Told(False, frozenset({3}), often)) for k in range(4)]
    assert credible(lucky, 40) == frozenset()
    several = [(k, Told(False, frozenset({3}), often if k < 2 else none)) for k in range(8)]
    assert credible(several, 40) == {3}
