"""What is left of a path's distances, by hand."""

import numpy as np
import pytest

from genpolicy.feasibility.kernels.sweep import least_left

BOUNDS = np.array([[0.1, 9.0], [0.5, 3.0], [0.6, 2.0]])
WAYS = np.array([[0.05, 1.0], [0.2, 0.5]])
ALL = np.ones((2, 2), dtype=bool)
HELD_ONLY = np.array([[True, False], [True, True]])
SECOND = np.array([[False, False], [False, True]])


@pytest.mark.parametrize(
    ("held", "asked", "swept", "expected"),
    [
        ((1, 1, 1), ALL, False, 0.5),  # the first point is where the arm stands already
        ((1, 1, 1), ALL, True, 0.1 - 0.05),
        ((1, 1, 1), SECOND, False, 2.0),
        ((1, 1, 0), SECOND, False, 3.0),  # let go at the last point
        ((1, 1, 0), SECOND, True, 2.0 - 0.5),  # held at its begin: held on the whole segment
        ((0, 0, 0), SECOND, True, np.inf),
        ((0, 0, 0), HELD_ONLY, False, 0.5),
    ],
)
def test_the_least_distance_over_what_is_asked(held, asked, swept, expected):
    held = np.array(held, dtype=bool)
    assert least_left(BOUNDS, WAYS, held, asked, swept, 0.0) == pytest.approx(expected)
    assert least_left(BOUNDS, WAYS, held, asked, swept, 0.25) == pytest.approx(expected - 0.25)
