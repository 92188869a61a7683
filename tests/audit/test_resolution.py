"""Clusters that the observation itself tells apart are no modes."""

import numpy as np
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.resolution import resolved_by_observation
from genpolicy.seeds import stream


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
