"""Primitives: they fill what the shapes fill, and stand where the collision model puts them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from genpolicy.replay.bodies import HELD_OPENING_M, frame_of, primitives
from genpolicy.robot.scene_state import SceneState
from genpolicy.robot.shapes import HELD, Shape
from genpolicy.tasks.api import Workspace

LOOK = (0.1, 0.2, 0.3, 0.4)
TURNED = Rotation.from_euler("xyz", [0.4, -0.3, 1.1]).as_matrix()
PLACE = np.array([0.5, -0.1, 0.2])


def shape(kind, half):
    return Shape("s", "b", kind, np.array(half), -1, np.eye(3), np.zeros(3), np.zeros(3))


def numbers(pose, part, names):
    return np.array([pose[part][name] for name in names])


@pytest.mark.parametrize("kind", ["box", "cylinder", "sphere", "capsule"])
def test_sizes_are_whole_and_not_half(kind):
    """Golden: by hand, from the shape's half sizes."""
    half = [0.02, 0.02, 0.02] if kind == "sphere" else [0.02, 0.02, 0.05]
    found = primitives([(shape(kind, half), TURNED, PLACE)], LOOK)
    kinds = {"box": "cubes", "sphere": "spheres"}
    [body] = found[kinds.get(kind, "cylinders")] if kind != "capsule" else found["cylinders"]
    assert list(body["size"].values()) == pytest.approx(2 * np.array(half))
    assert numbers(body["pose"], "position", "xyz") == pytest.approx(PLACE)
    q = Rotation.from_quat(numbers(body["pose"], "orientation", "xyzw"))
    np.testing.assert_allclose(q.as_matrix(), TURNED, atol=1e-5)
    assert list(body["color"].values()) == list(LOOK)


def test_a_capsule_is_longer_by_its_caps():
    found = primitives([(shape("capsule", [0.02, 0.02, 0.05]), TURNED, PLACE)], LOOK)
    ends = [numbers(ball["pose"], "position", "xyz") for ball in found["spheres"]]
    assert [ball["size"]["x"] for ball in found["spheres"]] == [0.04, 0.04]
    np.testing.assert_allclose(ends[1] - ends[0], 0.1 * TURNED[:, 2], atol=2e-6)
    np.testing.assert_allclose((ends[0] + ends[1]) / 2, PLACE, atol=2e-6)


def test_the_robot_stands_where_the_collision_model_puts_it(cell, task):
    q_rad = np.asarray(task.posture_rad)
    placements = cell.collision.placements(q_rad, opening_m=0.03)
    drawn = {one[0].name: one for one in cell.robot(q_rad, 0.03)}
    for shape_, (rotation, position) in zip(cell.collision.shapes.robot, placements, strict=True):
        if shape_.name != HELD:
            np.testing.assert_array_equal(drawn[shape_.name][1], rotation)
            np.testing.assert_array_equal(drawn[shape_.name][2], position)


def test_a_hand_that_is_open_holds_nothing(cell, task):
    q_rad = np.asarray(task.posture_rad)
    for opening_m, held in ((0.0, True), (HELD_OPENING_M, True), (HELD_OPENING_M + 1e-6, False)):
        assert (HELD in {one[0].name for one in cell.robot(q_rad, opening_m)}) is held


def test_fingers_close_around_what_they_hold_and_no_further(cell, task):
    q_rad, shapes = np.asarray(task.posture_rad), cell.collision.shapes
    closed, around = (
        {one[0].name: one[2] for one in cell.robot(q_rad, opening_m)}
        for opening_m in (0.0, shapes.held_half_width_m)
    )
    np.testing.assert_array_equal(closed["finger_left"], around["finger_left"])


def test_the_tool_at_a_pose_is_that_of_the_arm_there(cell, task):
    """Property: for a pose that the arm has, the rigid tool is where the joints put it."""
    rng = np.random.default_rng(5)
    for _ in range(5):
        q_rad = np.asarray(task.posture_rad) + rng.normal(0, 0.3, len(task.posture_rad))
        position, rotation = cell.collision.kinematics.forward(q_rad)
        expected = {one[0].name: one for one in cell.robot(q_rad, 0.01) if one[0].tool}
        found = {one[0].name: one for one in cell.tool(position, rotation, 0.01)}
        assert set(found) == set(expected) and found
        for name, (_, turned, place) in found.items():
            np.testing.assert_allclose(turned, expected[name][1], atol=1e-9)
            np.testing.assert_allclose(place, expected[name][2], atol=1e-9)


def test_scene_bodies_stand_where_they_were_seen(cell):
    name = cell.obstacles[0]
    seen = SceneState({name: (np.array([0.45, 0.05, 0.1]), np.array([1.0, 0, 0, 0]))})
    before = {one[0].name: one[2] for one in cell.scene(SceneState())}
    after = {one[0].name: (one[0].body, one[2]) for one in cell.scene(seen)}
    for shape_, (body, place) in after.items():
        assert np.array_equal(place, before[shape_]) is (body != name)


def test_each_thing_has_the_colour_of_what_it_is(cell, task):
    shapes = cell.collision.shapes
    looks = {s.name: cell.look(s) for s in (*shapes.robot, *shapes.scene)}
    of_body = {s.body: looks[s.name] for s in shapes.scene}
    assert len({looks[HELD], looks["link0"], of_body["world"], of_body[cell.obstacles[0]],
                of_body[shapes.target_body]}) == 5  # fmt: skip


def test_the_workspace_has_twelve_edges_along_the_axes():
    found = frame_of(Workspace((0.0, 1.0, 2.0), (1.0, 3.0, 5.0)))
    points = np.array([[p[axis] for axis in "xyz"] for p in found["points"]]).reshape(-1, 2, 3)
    assert found["type"] == 2 and len(points) == 12
    lengths = sorted(np.abs(points[:, 1] - points[:, 0]).sum(axis=1))
    assert lengths == [1.0] * 4 + [2.0] * 4 + [3.0] * 4
    assert all(np.count_nonzero(a != b) == 1 for a, b in points)
