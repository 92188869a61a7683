"""Outlines: corners by hand, and of several shapes what lies around all of them."""

import numpy as np
import pytest

from genpolicy.robot.outlines import outlines
from genpolicy.robot.shapes import Shape

STRAIGHT = np.eye(3)


def shape(kind, *half):
    return Shape("a", "a", kind, np.array(half), -1, STRAIGHT, np.zeros(3), np.zeros(3), tool=False)


def box(corners):
    return np.min(corners, axis=0), np.max(corners, axis=0)


@pytest.mark.parametrize(
    ("kind", "half", "above", "aside"),
    [
        ("box", (0.1, 0.2, 0.3), (0.1, 0.2), (0.1, 0.3)),
        ("cylinder", (0.1, 0.1, 0.3), (0.1, 0.1), (0.1, 0.3)),
        ("capsule", (0.1, 0.1, 0.3), (0.1, 0.1), (0.1, 0.4)),
        ("sphere", (0.1, 0.1, 0.1), (0.1, 0.1), (0.1, 0.1)),
    ],
)
def test_an_outline_reaches_as_far_as_its_shape(kind, half, above, aside):
    at = np.array([1.0, 2.0, 3.0])
    found = outlines([(shape(kind, *half), STRAIGHT, at)])
    for corners, reach, axes in zip(found, (above, aside), ([0, 1], [0, 2]), strict=True):
        low, high = box(corners)
        np.testing.assert_allclose(low, at[axes] - reach, atol=1e-12)
        np.testing.assert_allclose(high, at[axes] + reach, atol=1e-12)


def test_a_turned_box_is_seen_turned():
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    above, _ = outlines([(shape("box", 0.1, 0.2, 0.3), quarter, np.zeros(3))])
    np.testing.assert_allclose(box(above)[1], (0.2, 0.1))
    assert len(above) == 4


def test_two_shapes_have_one_outline():
    ball = shape("box", 0.1, 0.1, 0.1)
    apart = [(ball, STRAIGHT, np.zeros(3)), (ball, STRAIGHT, np.array([1.0, 0.0, 0.0]))]
    above, aside = outlines(apart)
    for corners in (above, aside):
        np.testing.assert_allclose(box(corners), [(-0.1, -0.1), (1.1, 0.1)])
