"""Energy distance: zero of equal sets, by hand of two points, and blind to order."""

import numpy as np
import pytest

from genpolicy.monitors.distances import energy_distance


def test_two_points_by_hand():
    """Two single chunks that are 5 apart: 2 * 5 - 0 - 0."""
    one, other = np.zeros((1, 2, 1)), np.array([[[3.0], [4.0]]])
    assert energy_distance(one, other) == pytest.approx(10.0)


def test_equal_sets_are_no_distance_apart_in_any_order():
    draws = np.random.default_rng(0).normal(size=(5, 3, 2))
    assert energy_distance(draws, draws[::-1]) == pytest.approx(0.0, abs=1e-12)


def test_one_mode_out_of_two_is_nearer_than_another_place():
    both = np.array([[[-1.0]], [[1.0]]])
    assert energy_distance(both, both[:1]) < energy_distance(both, both + 2.0)
