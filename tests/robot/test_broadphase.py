"""Which pairs are held against each other follows from the kinematic tree alone."""

import re

import pytest

from genpolicy.errors import ConfigError
from genpolicy.robot.broadphase import self_pairs
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.shapes import shapes_of

# Named by hand from the maker's drawing: hand, fingers and what they hold against base and arm.
TOOL = ("hand", "finger_left", "finger_right", "held")
LINKS = ("link0", "link1", "link2", "link3")


def names(shapes):
    return [(shapes.robot[i].name, shapes.robot[j].name) for i, j in self_pairs(shapes.robot)]


def test_the_default_arm_has_exactly_its_sixteen_pairs(scene_path):
    shapes = shapes_of(scene_path, joints=7)
    assert names(shapes) == [(tool, link) for tool in TOOL for link in LINKS]


def test_other_body_names_give_the_same_pairs(scene_path, tmp_path):
    text = scene_path.read_text()
    for name in ("hand", "left_finger", "right_finger", *(f"link{i}" for i in range(8))):
        text = re.sub(rf'(body1?(?: name)?=")({name})"', rf'\1other_{name}"', text)
        text = re.sub(rf'<body name="{name}"', f'<body name="other_{name}"', text)
    other = tmp_path / "scene.xml"
    other.write_text(text)
    renamed = shapes_of(other, joints=7)
    assert {shape.body for shape in renamed.robot} & {*LINKS, "hand"} == set()
    assert self_pairs(renamed.robot) == self_pairs(shapes_of(scene_path, joints=7).robot)


def test_without_a_tool_the_last_link_stands_for_it(scene_path):
    shapes = shapes_of(scene_path, joints=7)
    bare = tuple(shape for shape in shapes.robot if not shape.tool)
    assert {(bare[i].name, bare[j].name) for i, j in self_pairs(bare)} == {
        ("link7", link) for link in LINKS
    }


def test_a_model_without_self_pairs_is_a_configuration_error(tmp_path):
    scene = tmp_path / "scene.xml"
    scene.write_text(
        "<mujoco><worldbody><geom name='floor' type='box' size='1 1 .1' group='3'/>"
        "<body name='a'><joint name='j1' axis='0 0 1'/><geom size='.1' group='1'/>"
        "<body name='b' pos='0 0 1'><joint name='j2' axis='0 0 1'/><geom size='.1' group='1'/>"
        "<site name='tcp'/></body></body></worldbody></mujoco>"
    )
    with pytest.raises(ConfigError, match="no pair of robot shapes that could meet"):
        CollisionModel(scene, ArmKinematics(scene))
