"""Which situations count as having modes: phases must keep them, and the place must not decide."""

from types import SimpleNamespace

import numpy as np
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.resolution import resolved_by_observation
from genpolicy.audit.situations import Situation, coherent
from genpolicy.seeds import stream

CHUNKS = SimpleNamespace()


def situation(phase, kept, two_mode=True, ratio=0.1):
    """One situation; `kept` is None (not measurable), True or False."""
    null = np.linspace(0.0, 0.8, 99)
    identity = None if kept is None else (1.0 if kept else 0.5, null)
    return Situation(phase, None, None, two_mode, identity, CHUNKS, ratio, 0.01)


def phases(situations):
    kept, lost = coherent(SETTINGS, tuple(situations))
    return {item.phase for item in kept if item.two_mode}, lost


def test_a_phase_in_which_few_situations_persist_loses_its_modes():
    many = [situation("approach", True)] * 9 + [situation("approach", False)]
    few = [situation("align", k < 3) for k in range(10)]
    assert phases(many + few) == ({"approach"}, 10)
    assert phases(few) == (set(), 10)


def test_a_phase_that_ends_too_soon_counts_only_alone():
    short = [situation("retreat", None)] * 8
    assert phases(short) == ({"retreat"}, 0)
    assert phases([*short, *[situation("approach", True)] * 6]) == ({"approach"}, 8)
    assert phases([*short, *[situation("align", False)] * 6]) == ({"retreat"}, 6)


def test_clusters_of_white_noise_are_no_modes():
    white = [situation("approach", True, ratio=0.9)] * 10
    assert phases(white) == (set(), 10)
    assert phases([*white, *[situation("align", True)] * 6]) == ({"align"}, 10)


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
