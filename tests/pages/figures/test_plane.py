"""How positions come onto paper: one component over the steps, a scene, or a main direction."""

import numpy as np
import pytest

from genpolicy.pages.figures.plane import main_direction, plane_of, scatter_of


def test_one_component_is_drawn_over_the_steps():
    path = np.linspace(3.0, 4.0, 8)[:, None]
    plane = plane_of([path], ["width_m"], "m")
    assert not plane.is_scene and plane.y_label == "width, m"
    line = plane.line(path)
    assert np.array_equal(line[:, 0], np.arange(8)) and np.array_equal(line[:, 1], path[:, 0])


@pytest.mark.parametrize("still", [0, 1, 2])
def test_a_scene_is_seen_along_the_axis_in_which_least_happens(still):
    path = np.random.default_rng(1).normal(size=(16, 3))
    path[:, still] = 0.5
    plane = plane_of([path], ["x", "y", "z"], "m")
    assert plane.columns == tuple(axis for axis in range(3) if axis != still)
    assert plane_of([path], ["x", "y", "z"], "m", from_above=True).columns == (0, 1)


def test_a_gripper_beside_a_tool_leaves_the_scene_a_scene_and_two_arms_do_not():
    path = np.random.default_rng(3).normal(size=(16, 4)) * [1, 3, 2, 9]
    names = ["tcp.x", "tcp.y", "tcp.z", "gripper.opening"]
    assert plane_of([path], names, "m").columns == (1, 2)
    assert plane_of([path], names, "m").y_label == "z, m"
    assert plane_of([path], names, "m", from_above=True).columns == (0, 1)
    arms = [f"{arm}.{axis}" for arm in ("left", "right") for axis in "xyz"]
    assert not plane_of([np.ones((4, 6)) * np.arange(4)[:, None]], arms, "m").is_scene


def test_joints_are_drawn_along_the_direction_in_which_the_paths_differ():
    truth = np.zeros(26)
    truth[7], truth[9] = 0.6, 0.8
    steps = np.linspace(0.0, 1.0, 12)[:, None]
    paths = [5.0 + sign * steps * truth for sign in (1, -1)]
    plane = plane_of(paths, [f"j{i}" for i in range(26)], "rad")
    assert np.allclose(plane.direction, truth, atol=1e-12)
    ends = [plane.line(path)[-1, 1] for path in paths]
    assert np.allclose(ends, [1.0, -1.0])  # from each path's own start, so 5.0 plays no part


def test_a_main_direction_has_its_largest_component_positive_and_length_one():
    points = np.random.default_rng(2).normal(size=(50, 6)) * [1, 9, 1, 4, 1, 1]
    axes = main_direction(points, count=2)
    assert np.allclose(np.linalg.norm(axes, axis=1), 1.0)
    assert np.argmax(np.abs(axes), axis=1).tolist() == [1, 3]
    assert np.all(axes[[0, 1], [1, 3]] > 0)
    assert np.allclose(axes, main_direction(points + 100.0, count=2), atol=1e-9)


def test_a_scatter_says_how_much_of_the_spread_it_shows():
    points = np.zeros((40, 5))
    points[:, 2] = np.linspace(-3, 3, 40)
    points[:, 4] = np.tile([-1.0, 1.0], 20)
    places, first, second = scatter_of(points, list("abcde"), "rad")
    assert places.shape == (40, 2)
    total = np.sum(points[:, 2] ** 2) + np.sum(points[:, 4] ** 2)
    assert f"{np.sum(places[:, 0] ** 2) / total:.0%}" in first and "rad" in second
