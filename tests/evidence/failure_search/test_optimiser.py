"""The optimiser spends its budget exactly, comes closer, and is a function of what it is told."""

import numpy as np
import pytest

from genpolicy.evidence.failure_search.optimiser import search
from genpolicy.seeds import stream

CORNER = np.array([0.9, 0.1, 0.8, 0.5])


def distance(points):
    return [float(np.linalg.norm(point - CORNER)) for point in points]


def asked(worth=distance, *, evaluations=120, seed=3):
    """Every point that a search asks for, in order. Shape (n, 4)."""
    points = []

    def evaluate(generation):
        points.extend(generation)
        return worth(generation)

    search(evaluate, dimensions=4, evaluations=evaluations, generator=stream(seed, "search"))
    return np.array(points).reshape(-1, 4)


@pytest.mark.parametrize("evaluations", [0, 1, 7, 8, 9, 50])
def test_the_budget_is_spent_exactly(evaluations):
    assert len(asked(evaluations=evaluations)) == evaluations


def test_points_lie_in_the_cube_and_come_closer():
    points = asked()
    assert ((points >= 0) & (points <= 1)).all()
    away = np.linalg.norm(points - CORNER, axis=1)
    assert np.median(away[-24:]) < 0.3 * np.median(away[:24])


def test_the_same_worths_are_asked_the_same_and_others_others():
    first = asked()
    np.random.seed(99)  # whoever else draws
    assert asked().tobytes() == first.tobytes()
    assert asked(seed=4)[0].tolist() != first[0].tolist()
    other = asked(lambda points: [-value for value in distance(points)])
    assert other[:8].tolist() == first[:8].tolist(), "nothing was told yet"
    assert other[8:].tolist() != first[8:].tolist()


def test_a_search_that_has_converged_begins_elsewhere(monkeypatch):
    """Where every point is worth the same, the library says after a while that it has converged."""
    flat = asked(lambda points: [0.0] * len(points), evaluations=1200)
    centres = [flat[place : place + 8].mean(axis=0) for place in range(0, 1200, 8)]
    jumps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    assert len(flat) == 1200 and jumps.max() > 0.2
