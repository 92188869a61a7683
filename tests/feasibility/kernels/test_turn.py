"""Rotations of a row against `contract.rotation`."""

from itertools import pairwise

import numpy as np
import pytest

from genpolicy.contract.rotation import angle_between, rotation_from_6d, rotation_to_6d
from genpolicy.feasibility.kernels.turn import angle, from_columns, from_rows, to_columns


def test_rotations_of_rows_are_those_of_the_contract():
    rows = np.random.default_rng(0).normal(0, 1, (5, 40, 10))
    found = np.empty((5, 40, 3, 3))
    from_rows(rows, 3, found)
    assert np.allclose(found, rotation_from_6d(rows[..., 3:9]), atol=1e-14, rtol=0)
    row = np.zeros(10)
    to_columns(found[0, 0], row, 3)
    assert np.array_equal(row[3:9], rotation_to_6d(found[0, 0]))


@pytest.mark.parametrize(
    "columns",
    [
        (0, 0, 0, 0, 1, 0),
        (1, 0, 0, 2, 0, 0),
        (1, 0, 0, 0, 0, 0),
        (np.nan, 0, 0, 0, 1, 0),
        (1, 0, 0, 0, np.inf, 0),
        (np.inf, 0, 0, 0, 1, 0),
        (1e200, 0, 0, 0, 1, 0),
        (1e-7, 0, 0, 0, 1, 0),
    ],
)
def test_what_is_no_rotation_is_none_in_both(columns):
    found = np.empty((3, 3))
    good = from_columns(np.array(columns, dtype=float), 0, found)
    with np.errstate(all="ignore"):
        expected = rotation_from_6d(np.array(columns, dtype=float))
    assert good == np.isfinite(expected).all()
    if good:
        assert np.allclose(found, expected, atol=1e-14)
    else:
        assert not np.isfinite(found).all()


def test_angles_are_those_of_the_contract():
    turns = rotation_from_6d(np.random.default_rng(1).normal(0, 1, (60, 6)))
    for first, second in pairwise(turns):
        assert angle(first, second) == pytest.approx(float(angle_between(first, second)), abs=1e-12)
    assert angle(turns[0], turns[0].copy()) == pytest.approx(0, abs=1e-12)
