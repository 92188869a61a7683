"""The six-number rotation: there and back, known angles, and NaN where it describes nothing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from genpolicy.contract.rotation import (
    angle_between,
    orthonormality_error,
    rotation_from_6d,
    rotation_to_6d,
)

quaternions = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(
    lambda q: np.linalg.norm(q) > 0.1
)


@given(quaternions)
def test_there_and_back_is_the_same_rotation(quaternion):
    rotation = Rotation.from_quat(quaternion).as_matrix()
    columns = rotation_to_6d(rotation)
    np.testing.assert_allclose(rotation_from_6d(columns), rotation, atol=1e-12)
    assert orthonormality_error(columns) < 1e-12


@given(st.lists(st.floats(-10, 10), min_size=6, max_size=6))
def test_any_six_numbers_are_a_rotation_or_not_a_number(columns):
    """The second and third column are NaN wherever the six numbers span no plane."""
    rotation = rotation_from_6d(np.array(columns))
    if np.isnan(rotation).any():
        assert np.isnan(rotation[:, 1:]).all()
    else:
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(rotation) == pytest.approx(1.0)


@given(quaternions, st.floats(-3, 3), st.floats(0.1, 10), st.floats(0.1, 10))
def test_only_directions_count(quaternion, shear, first, second):
    """Gram-Schmidt takes away what the second column has of the first, and both lengths."""
    rotation = Rotation.from_quat(quaternion).as_matrix()
    x, y = rotation[:, 0], rotation[:, 1]
    columns = np.concatenate([first * x, second * y + shear * x])
    np.testing.assert_allclose(rotation_from_6d(columns), rotation, atol=1e-9)


def test_a_quarter_turn_about_z():
    """By hand: x goes to y, y goes to -x."""
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(rotation_to_6d(quarter), [0, 1, 0, -1, 0, 0])
    np.testing.assert_array_equal(rotation_from_6d(np.array([0, 1.0, 0, -1, 0, 0])), quarter)
    assert angle_between(np.eye(3), quarter) == pytest.approx(np.pi / 2)


@pytest.mark.parametrize(
    "columns",
    [[0, 0, 0, 0, 1, 0], [1, 0, 0, 0, 0, 0], [1, 2, 3, -2, -4, -6], [np.nan, 0, 0, 0, 1, 0]],
    ids=["no first", "no second", "parallel", "not a number"],
)
def test_what_spans_no_plane_is_nan_and_leaves_its_neighbours_alone(columns):
    both = rotation_from_6d(np.array([columns, [1.0, 0, 0, 0, 1, 0]]))
    assert np.isnan(both[0]).any()
    np.testing.assert_array_equal(both[1], np.eye(3))


def test_the_error_names_length_and_angle():
    assert orthonormality_error(np.array([2.0, 0, 0, 0, 1, 0])) == pytest.approx(1.0)
    tilted = np.array([1.0, 0, 0, np.sin(0.1), np.cos(0.1), 0])
    assert orthonormality_error(tilted) == pytest.approx(np.sin(0.1))


@given(quaternions, st.floats(0, np.pi))
def test_the_angle_is_that_of_the_turn_between(quaternion, angle_rad):
    first = Rotation.from_quat(quaternion).as_matrix()
    second = first @ Rotation.from_rotvec([0, 0, angle_rad]).as_matrix()
    assert angle_between(first, second) == pytest.approx(angle_rad, abs=1e-6)
    assert angle_between(second, first) == pytest.approx(angle_rad, abs=1e-6)
