"""Sphere bounds: by hand, and against the robot's broad phase."""

import numpy as np
import pytest

from benchmarks.feasibility.plain import plain_cell
from genpolicy.feasibility.kernels.spheres import between, to_box

UPRIGHT = np.array([[[0.0, 0.0, 0.0, 1.0, 0.0]]])
BOX = np.array([[0.0, 0.0, 0.0, 1.0, 2.0, 3.0]])


@pytest.mark.parametrize(
    ("centre", "expected"),
    [((4, 0, 0), 3), ((4, 6, 0), 5), ((0, 0, 0), -1), ((0, 1.5, 0), -0.5), ((1, 0, 0), 0)],
)
def test_the_distance_to_a_box_is_signed(centre, expected):
    spheres = np.array([[[9.0, 9.0, 9.0], centre]], dtype=float)
    assert to_box(spheres, 0, 1, 2, UPRIGHT, 0, BOX) == pytest.approx(expected, abs=1e-15)
    assert to_box(spheres, 0, 0, 2, UPRIGHT, 0, BOX) == pytest.approx(expected, abs=1e-15)


def test_a_box_turns_with_its_body():
    turned = np.array([[[0.0, 0.0, 0.0, 0.0, 1.0]]])  # a quarter turn: x is 2 long, y is 1
    spheres = np.array([[[4.0, 0.0, 0.0]]])
    assert to_box(spheres, 0, 0, 1, turned, 0, BOX) == pytest.approx(2)


def test_the_nearest_two_centres_decide():
    spheres = np.array([[[0.0, 0, 0], [5, 0, 0], [6, 0, 0], [0, 9, 0]]])
    assert between(spheres, 0, 0, 2, 2, 4) == pytest.approx(1)
    assert between(spheres, 0, 0, 1, 2, 4) == pytest.approx(6)


def test_bounds_and_travel_are_those_of_the_robot(cell, kit):
    ours, theirs = cell.collision.broad, plain_cell(cell).collision.broad
    rng, arm = np.random.default_rng(0), cell.kinematics
    q = rng.uniform(arm.lower_rad, arm.upper_rad, (200, cell.joint_count))
    opening, bend = rng.uniform(0, 0.04, 200), rng.uniform(0, 0.01, 200)
    poses = cell.collision.poses(tuple(kit.scene(hole_yaw_rad=y) for y in rng.normal(0, 1, 200)))
    frames = arm.frames(q), arm.frames(q + rng.normal(0, 0.05, q.shape))
    spheres = [ours.centres(f, opening) for f in frames]
    expected = [theirs.centres(f, opening) for f in frames]
    assert np.allclose(spheres, expected, atol=1e-13, rtol=0)
    bounds = ours.lower_bounds(spheres[0], poses)
    assert np.allclose(bounds, theirs.lower_bounds(spheres[0], poses), atol=1e-13, rtol=0)
    moved = np.linalg.norm(spheres[1] - spheres[0], axis=2)
    assert np.allclose(
        ours.between(frames, (spheres[0], spheres[1]), bend),
        theirs.travel(*frames, moved, bend), atol=1e-13, rtol=0,
    )  # fmt: skip
