"""Support, structure and data semantics move with the episodes that are drawn."""

from types import SimpleNamespace

import numpy as np
import pytest
from planar import SETTINGS, planar

from genpolicy.audit.counts import count
from genpolicy.audit.data import canonical
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood, Support
from genpolicy.audit.situations import Situation
from genpolicy.audit.structure_draws import finding_draws, queries_of, structure_draw

DATA = SimpleNamespace(
    episode=np.repeat(np.arange(4), 10), position=np.zeros((40, 0)), forms=None,
    action=np.zeros((40, 1)), action_position=slice(0, 1),
    first_row=np.repeat(np.arange(4), 10) * 10, last_row=np.repeat(np.arange(4), 10) * 10 + 9,
)  # fmt: skip


def situation(row, phase="reach", clusters=2, two_mode=True, ratio=0.1):
    split = Clustering(np.arange(4) % clusters, 0.1, tuple(range(clusters)))
    place = Neighbourhood(row, np.array([1, 2, 3]), np.zeros(3))
    return Situation(phase, place, split, two_mode, None, None, ratio, 0.01, white_share=ratio / 2)


ITEMS = (situation(0), situation(1), situation(10, "align", 2, False, 0.9))
SUPPORT = (Support("reach", 4, 3, (21, 30)),)


def drawn(*times):
    queries = queries_of(DATA, SETTINGS, ITEMS, SUPPORT)
    measured = count(DATA, ITEMS, SUPPORT, 0)
    kept = np.array([1.0, 1.0, 0.0])
    return structure_draw(
        queries, np.array(times), kept, measured=measured, findings=2, successes=(3,)
    )


def test_every_episode_once_gives_what_was_measured():
    row = drawn(1, 1, 1, 1)
    assert (row.queries, row.analysed, row.analysed_episodes) == (5, 3, 2)
    assert (row.findings, row.successes) == (2, (3,))
    assert (row.primary_episodes, row.resolved, row.noise_ratio) == (1, 1, 0.1)
    assert sum(row.reach_queries) == 5 and sum(row.reach_spoke) == 3 and row.findings == 2


def test_support_moves_with_the_episodes():
    poor, rich = drawn(0, 1, 3, 0), drawn(4, 0, 0, 0)
    assert (poor.queries, poor.analysed, poor.analysed_episodes) == (4, 1, 1)
    assert (poor.primary_episodes, poor.noise_ratio, poor.white_share) == (0, 0.9, 0.45)
    assert (rich.queries, rich.analysed, rich.analysed_episodes, rich.resolved) == (8, 8, 4, 0)


@pytest.mark.parametrize(("steps", "always"), [(0, False), (2, True)])
def test_a_clock_that_is_late_is_so_in_every_half(steps, always):
    data = canonical(planar(episodes=60, modes="none", clock_steps=steps)[0])
    halves, found = finding_draws(data, SETTINGS, root_seed=1)
    clocks = {row.draw for row in found if row.question == "clock_residual_s"}
    assert halves == 10 and clocks == (set(range(10)) if always else set())


def test_too_many_rows_are_not_measured_again():
    data = SimpleNamespace(observation=range(10**6), episodes=range(100))
    assert finding_draws(data, SETTINGS, root_seed=1) == (0, ())
