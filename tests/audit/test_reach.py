"""Fifths of the way: what an episode travels, not how long it stands."""

from types import SimpleNamespace

import numpy as np
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical
from genpolicy.audit.reach import FIFTHS, departures, fifth_of, reaches, with_departures
from genpolicy.audit.reach_rows import LOCAL

HALF = SETTINGS.chunk_rows // 2


def episode(position):
    n = len(position)
    return SimpleNamespace(
        episode=np.zeros(n, int), position=np.asarray(position, float),
        first_row=np.zeros(n, int), last_row=np.full(n, n - 1),
    )  # fmt: skip


def test_who_waits_does_not_come_forward():
    way = np.linspace(0.0, 1.0, 21)[:, None]
    waiting = np.concatenate([np.zeros((50, 1)), way, np.full((50 + HALF, 1), 1.0)])
    found = fifth_of(episode(waiting), SETTINGS, np.array([0, 49, 55, 60, 65, 69, 71, 100]))
    assert found.tolist() == [0, 0, 1, 2, 3, 4, 4, 4]


def test_where_nothing_travels_rows_are_counted():
    still = fifth_of(episode(np.zeros((100 + HALF, 0))), SETTINGS, np.array([0, 30, 50, 99]))
    assert still.tolist() == [0, 1, 2, 4]


def test_each_fifth_says_of_how_much_it_could_speak():
    rows = reaches(LOCAL, np.array([0, 0, 4]), [True, False, True])
    assert [(row.fifth, row.queries, row.spoke) for row in rows] == [
        (1, 2, 1), (2, 0, 0), (3, 0, 0), (4, 0, 0), (5, 1, 1),
    ]  # fmt: skip
    assert (rows[0].share, rows[1].share) == (0.5, 1.0)


def test_departures_stand_for_the_first_fifth_where_hardly_any_could_be_looked_at():
    fifths = np.repeat([0, 1], [80, 40])
    departs = np.arange(120) < 30
    seeing, blind = np.ones(120, bool), np.arange(120) >= 27
    assert with_departures(fifths, departs, seeing) is fifths
    found = with_departures(fifths, departs, blind)
    assert np.array_equal(found, np.repeat([0, FIFTHS, 1], [30, 50, 40]))
    assert reaches(LOCAL, found, blind)[0].share == 0.1
    # Of a few departures nothing follows, and neither where the others say as little.
    assert with_departures(fifths, np.arange(120) < 19, blind) is fifths
    assert with_departures(fifths, departs, np.arange(120) % 10 == 9) is fifths
    assert with_departures(fifths, departs, np.zeros(120, bool)) is fifths


def test_a_departure_is_the_begin_of_the_motion():
    data = canonical(planar()[0])
    rows = np.arange(len(data.episode))
    found = departures(data, SETTINGS, rows)
    first = rows == data.first_row
    assert found[first].all()
    count = np.bincount(data.episode[found])
    assert (count >= SETTINGS.chunk_rows // 4).all()
    assert found.mean() < 0.5
