"""Two columns that only together decide are named; what decides alone, or not, makes no pair."""

from dataclasses import replace

import numpy as np
import pytest
from planar import SETTINGS, named, planar
from planar import admissible as check

from genpolicy.audit.data import canonical
from genpolicy.audit.pairs import LEVEL, MOST_COLUMNS, with_pairs
from genpolicy.audit.run import audit
from genpolicy.audit.variable import Variable, numbered
from genpolicy.seeds import stream

N = 100


@pytest.fixture(scope="module")
def plain():
    """Rows of which nothing is recorded, and the side of each episode."""
    data = canonical(planar(episodes=N)[0])
    blank = np.full(N, "")
    table = replace(data.episodes, operator=blank, object=blank, calibration_epoch=blank)
    data = replace(data, episodes=table)
    result = audit(data, SETTINGS, admissible=check, replay=None, root_seed=3)
    return data, result.links


def columns(seed, side, *, count=6, kinds=2):
    """Two columns whose sum is the side, and others that say nothing."""
    rng = stream(seed, "pairs")
    first = rng.integers(0, kinds, len(side))
    told = {"lamp": first, "batch": (side - first) % kinds}
    told |= {f"n{k}": rng.integers(0, 2 + k % 3, len(side)) for k in range(count)}
    return tuple(Variable(name, numbered(values)) for name, values in told.items())


def pairs(data, links, variables):
    found = with_pairs(replace(data, variables=variables), links, root_seed=0)
    return [item.name for item in found if item not in variables]


def only(links):
    return links["approach"] if "approach" in links else next(iter(links.values()))


def test_what_decides_by_both_alone_is_the_cause(plain):
    data, links = plain
    variables = columns(1, np.maximum(only(links), 0))
    result = audit(
        replace(data, variables=variables), SETTINGS, admissible=check, replay=None, root_seed=3
    )
    cause = named(result)
    assert (cause.name, cause.variable) == ("hidden_state", "batch with lamp")


@pytest.mark.parametrize("kinds", [2, 3, 4])
def test_it_is_found_among_others_in_any_order(plain, kinds):
    data, links = plain
    variables = columns(2, np.maximum(only(links), 0), count=16, kinds=kinds)
    assert pairs(data, links, variables) == ["batch with lamp"]
    assert pairs(data, links, variables[::-1]) == ["batch with lamp"]


def test_a_column_that_decides_alone_makes_no_pair(plain):
    data, links = plain
    side = np.maximum(only(links), 0)
    variables = (*columns(3, side), Variable("who", numbered(side)))
    assert pairs(data, links, variables) == []
    noisy = np.where(stream(0, "noise").random(N) < 0.2, 1 - side, side)
    assert pairs(data, links, (*columns(3, side, count=0), Variable("who", numbered(noisy)))) == []


def test_a_label_is_one_of_the_two(plain):
    data, links = plain
    lamp, batch = columns(4, np.maximum(only(links), 0), count=0)
    who = np.array(["ann", "bob"])[batch.values]
    data = replace(data, episodes=replace(data.episodes, operator=who))
    assert pairs(data, links, (lamp,)) == ["lamp with operator"]


def test_columns_that_say_nothing_make_pairs_as_often_as_is_said(plain):
    """Exchangeable modes: chance of a pair is the level, whatever the number of columns."""
    data, links = plain
    found = 0
    for seed in range(150):
        rng = stream(seed, "nothing")
        variables = tuple(
            Variable(f"n{k}", numbered(rng.integers(0, 2 + k % 3, N))) for k in range(8)
        )
        found += bool(pairs(data, links, variables))
    assert found <= 2  # more than 2 of 150 at a chance of .001: once in 2,000 runs
    assert LEVEL == 0.001


def sessions(data, each=5):
    """The data, recorded in sessions, and the session of each episode."""
    table = replace(data.episodes, order=np.arange(N, dtype=float))
    return replace(data, episodes=table), np.arange(N) // each


def test_what_sessions_had_makes_no_pair_where_ways_lean_by_session(plain):
    """Free draws of single episodes call such columns a pair in one data set of four."""
    data, links = plain
    data, session = sessions(data)
    found = 0
    for seed in range(12):
        rng = stream(seed, "sessions")
        side = rng.integers(0, 2, 20)[session]
        modes = {phase: np.where(own < 0, own, side) for phase, own in links.items()}
        variables = tuple(
            Variable(f"n{k}", numbered(rng.integers(0, 2, 20)[session])) for k in range(8)
        )
        found += bool(pairs(data, modes, variables))
    assert found == 0


def test_a_pair_is_found_though_one_of_the_two_is_of_the_session(plain):
    data, links = plain
    data, session = sessions(data)
    side = np.maximum(only(links), 0)
    batch = stream(1, "batch").integers(0, 2, 20)[session]
    variables = Variable("batch", numbered(batch)), Variable("lamp", numbered((side - batch) % 2))
    assert pairs(data, links, variables) == ["batch with lamp"]


def test_what_a_measure_tells_alone_makes_no_pair(plain):
    data, links = plain
    number = stream(7, "thirds").permutation(N) / N
    modes = {p: np.where(m < 0, m, (number > 1 / 3) & (number <= 2 / 3)) for p, m in links.items()}
    high, low = (Variable(f"above{k}", numbered(number > k / 3)) for k in (1, 2))
    assert pairs(data, modes, (high, low)) == ["above1 with above2"]
    assert pairs(data, modes, (high, low, Variable("m", number))) == []


def test_a_calibration_is_no_part_of_a_pair(plain):
    """It is a defect of the data, not a cause that one could observe."""
    data, links = plain
    lamp, batch = columns(4, np.maximum(only(links), 0), count=0)
    epoch = np.array(["e0", "e1"])[batch.values]
    data = replace(data, episodes=replace(data.episodes, calibration_epoch=epoch))
    assert pairs(data, links, (lamp,)) == []


def test_without_few_valued_columns_the_variables_are_what_they_were(plain):
    data, links = plain
    measure = Variable("t", np.linspace(0.0, 1.0, N))
    many = Variable("k", numbered(np.arange(N) % 5))
    row = Variable("r", np.zeros(len(data.observation), dtype=np.int64), by_row=True)
    for variables in ((), (measure, many, row)):
        assert with_pairs(replace(data, variables=variables), links, root_seed=0) == variables


def test_more_columns_than_are_paired_cost_no_more(plain):
    data, links = plain
    rng = stream(5, "many")
    variables = tuple(
        Variable(f"n{k}", numbered(rng.integers(0, 2, N))) for k in range(4 * MOST_COLUMNS)
    )
    assert pairs(data, links, variables) == []
