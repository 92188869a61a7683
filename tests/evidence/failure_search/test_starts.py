"""Starts that are chosen are starts that the task could have drawn, and no others."""

from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.errors import ConfigError
from genpolicy.evidence.failure_search.starts import chosen_start, coordinates_of
from genpolicy.seeds import stream
from genpolicy.tasks.api import load_task
from genpolicy.tasks.tabletop_insertion.start import RANGES


@pytest.fixture(scope="module")
def insertion():
    return load_task("tabletop_insertion")


def test_every_number_of_a_start_is_a_coordinate_and_stays_in_its_range(insertion):
    assert coordinates_of(insertion) == len(RANGES)
    for end in (0.0, 0.5, 1.0):
        start = chosen_start(insertion, np.full(len(RANGES), end))
        for name, (centre, half) in RANGES.items():
            assert getattr(start, name) == pytest.approx(centre + half * (2 * end - 1))


def test_each_coordinate_moves_one_number(insertion):
    middle = vars(chosen_start(insertion, np.full(len(RANGES), 0.5)))
    for place, name in enumerate(RANGES):
        unit = np.full(len(RANGES), 0.5)
        unit[place] = 0.75
        moved = vars(chosen_start(insertion, unit))
        assert [key for key in middle if moved[key] != middle[key]] == [name]


def test_the_numbers_of_a_draw_give_the_start_of_that_draw(insertion):
    """What a generator gives is what the stand-in gives where it is handed the same numbers."""
    unit = stream(5, "there").random(len(RANGES))
    drawn = vars(insertion.sample_start(stream(5, "there")))
    chosen = vars(chosen_start(insertion, unit))
    assert chosen == pytest.approx(drawn, abs=1e-15)


def test_a_task_that_draws_many_at_once_is_chosen_alike(foreign_task):
    task = load_task(foreign_task)
    assert coordinates_of(task) == 4
    start = chosen_start(task, np.array([0.5, 0.5, 0.5, 1.0]))
    assert start.pillar_y_m == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("draw", "said"),
    [
        (lambda rng: rng.normal(), "drawing a start by `normal`"),
        (lambda rng: rng.uniform(size=65), "drawing more than 64 numbers"),
        (lambda rng: rng.uniform(np.zeros(65), 1.0), "drawing more than 64 numbers"),
        (lambda rng: rng.random(4, dtype=np.float32), "drawing a start with dtype"),
        (lambda rng: 0.5, "a start of which no number is drawn"),
    ],
)
def test_a_task_that_draws_otherwise_is_refused_by_name(draw, said):
    task = SimpleNamespace(name="odd", sample_start=draw)
    with pytest.raises(ConfigError, match=rf"task odd: sample_start is {said}"):
        coordinates_of(task)


@pytest.mark.parametrize("size", [None, 3, (2, 3)])
def test_ends_that_are_arrays_are_taken_as_numpy_takes_them(size):
    low, high = [0.0, 10.0, 20.0], np.array([1.0, 11.0, 22.0])
    drawn = stream(5, "there").uniform(low, high, size)
    unit = stream(5, "there").random(drawn.shape)
    task = SimpleNamespace(name="odd", sample_start=lambda rng: rng.uniform(low, high, size))
    assert coordinates_of(task) == drawn.size
    np.testing.assert_allclose(chosen_start(task, unit.ravel()), drawn, atol=1e-12)
