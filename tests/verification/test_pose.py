"""The checker's own reading of an action, held against the one that is checked."""

import numpy as np
import pytest

from genpolicy.contract import action, rotation
from genpolicy.verification.pose import (
    ACTION_DIM,
    GRIPPER,
    POSITION,
    ROTATION,
    angle_rad,
    turned_by,
    two_columns,
)

DRAWN = 20_000


def draws(seed=0):
    return np.random.default_rng(seed)


def test_an_action_has_the_layout_of_the_contract():
    assert action.ACTION_DIM == ACTION_DIM and action.GRIPPER == GRIPPER
    assert (action.POSITION, action.ROTATION) == (POSITION, ROTATION)


def test_both_read_the_same_rotation_of_random_columns():
    columns = draws().normal(size=(DRAWN, 6)) * 10.0 ** draws(1).uniform(-3, 3, (DRAWN, 1))
    own = turned_by(columns)
    # Of nearly parallel columns either loses digits by as much as they are near.
    apart = np.linalg.norm(np.cross(columns[:, :3], columns[:, 3:]), axis=1)
    apart /= np.prod(np.linalg.norm(columns.reshape(-1, 2, 3), axis=2), axis=1)
    off = np.abs(own - rotation.rotation_from_6d(columns)).max(axis=(1, 2))
    assert np.all(off <= 1e-14 / apart)
    assert np.allclose(np.einsum("nij,nik->njk", own, own), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(own), 1.0)


def test_a_rotation_and_its_columns_go_there_and_back():
    for turn in turned_by(draws(2).normal(size=(100, 6))):
        assert np.array_equal(two_columns(turn), rotation.rotation_to_6d(turn))
        assert np.allclose(turned_by(two_columns(turn)), turn, atol=1e-12)


@pytest.mark.parametrize(
    "columns",
    [(0, 0, 0, 0, 1, 0), (1, 0, 0, 0, 0, 0), (1, 0, 0, 2, 0, 0), (1, 2, 3, -2, -4, -6),
     (1e-7, 0, 0, 0, 1, 0), (1, 0, 0, 1, 1e-7, 0), (np.nan, 0, 0, 0, 1, 0),
     (1, 0, 0, 0, np.nan, 0), (0, 0, 0, 0, 0, 0)],
)  # fmt: skip
def test_what_spans_no_plane_is_no_rotation_to_either(columns):
    columns = np.array(columns, dtype=float)
    with np.errstate(invalid="raise", divide="raise"):
        own = turned_by(columns)
    assert np.isnan(own).all() and np.isnan(rotation.rotation_from_6d(columns)[..., 1]).all()
    assert not angle_rad(np.eye(3), own) <= np.inf, "no limit is kept by what is none"


@pytest.mark.parametrize("columns", [(2e-6, 0, 0, 0, 1, 0), (5, 0, 0, 5, 2e-6, 0)])
def test_what_hardly_spans_one_is_a_rotation_to_both(columns):
    columns = np.array(columns, dtype=float)
    assert np.allclose(turned_by(columns), rotation.rotation_from_6d(columns), atol=1e-9)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-7, 1e-3, 0.5, 2.0, 3.0])
def test_an_angle_is_the_one_that_was_turned_by(size):
    """A turn about any axis, by Rodrigues' formula; both say how far it was."""
    axes = draws(3).normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    cross = np.cross(np.eye(3), axes[:, None])
    turn = np.eye(3) + np.sin(size) * cross + (1 - np.cos(size)) * cross @ cross
    begun = turned_by(draws(4).normal(size=(200, 6)))
    told = angle_rad(begun, begun @ turn)
    assert np.allclose(told, size, rtol=1e-7, atol=1e-14)
    assert np.allclose(told, rotation.angle_between(begun, begun @ turn), rtol=0, atol=1e-12)


def test_half_a_turn_and_random_pairs():
    first, second = (turned_by(draws(seed).normal(size=(DRAWN, 6))) for seed in (5, 6))
    assert np.allclose(angle_rad(first, second), rotation.angle_between(first, second), atol=1e-7)
    half = np.diag([-1.0, 1.0, -1.0])
    assert np.isclose(angle_rad(np.eye(3), half), np.pi, atol=1e-7)
