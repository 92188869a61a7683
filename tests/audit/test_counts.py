"""Counts: situations and held-out episodes, those claimed as modes and those that are not."""

from types import SimpleNamespace

import numpy as np

from genpolicy.audit.counts import count
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood, Support
from genpolicy.audit.situations import Situation

NULL = np.linspace(0.0, 0.5, 99)
# Ten rows to each of four held-out episodes.
DATA = SimpleNamespace(episode=np.repeat(np.arange(4), 10))


def situation(row, phase, *, clusters=2, two_mode=True, kept=0.9, ratio=0.1, spread=0.01):
    clustering = Clustering(np.arange(4) % clusters, 0.1, tuple(range(clusters)))
    place = Neighbourhood(row, np.array([1, 2, 3]), np.zeros(3))
    return Situation(phase, place, clustering, two_mode, (kept, NULL), None, ratio, spread)


def test_rows_of_one_episode_are_several_situations_and_one_episode():
    found = count(
        DATA,
        (
            situation(0, "approach", ratio=0.2), situation(1, "approach"),
            situation(10, "approach", kept=0.1),
            situation(20, "align", clusters=1, two_mode=False, ratio=0.9, spread=0.03),
            situation(30, "align", two_mode=False), situation(31, "align", two_mode=False),
        ),
        (Support("approach", 5, 3), Support("align", 4, 3)),
        incoherent=1,
    )  # fmt: skip
    assert (found.queries, found.analysed, found.analysed_episodes) == (9, 6, 4)
    assert (found.two_mode, found.two_mode_episodes, found.persistent) == (3, 2, 2)
    # Two have clusters that are not claimed; one of them because its phase does not persist.
    assert (found.resolved, found.incoherent) == (1, 1)
    assert found.primary_episodes == 2  # of the phase with modes, "approach"
    assert (found.noise_ratio, found.noise_spread) == (0.1, 0.01)


def test_without_modes_there_is_no_primary_phase_and_without_situations_no_spread():
    single = situation(0, "approach", clusters=1, two_mode=False)
    assert count(DATA, (single,), (Support("approach", 1, 1),), 0).primary_episodes == 0
    nothing = count(DATA, (), (Support("approach", 7, 0),), 0)
    assert (nothing.queries, nothing.analysed, nothing.noise_ratio) == (7, 0, 0.0)
