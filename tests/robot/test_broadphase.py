"""Which pairs are held against each other follows from the kinematic tree alone."""

import re

import mujoco
import numpy as np
import pytest

from genpolicy.errors import ConfigError
from genpolicy.robot.broadphase import self_pairs
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.scene_state import SceneState
from genpolicy.robot.shapes import shapes_of
from genpolicy.verification.body import OwnBody

# Along the chain by hand, from the maker's drawing; tool and what it holds hang behind link 7.
LINKS = [f"link{i}" for i in range(8)]
TOOL = ("hand", "finger_left", "finger_right", "held")
APART = 3
PAIRS = {(LINKS[i], LINKS[j]) for i in range(8) for j in range(8) if i - j >= APART}


def mujoco_of(scene_path):
    """The scene with the robot's own contacts, what is held far away."""
    model = mujoco.MjModel.from_xml_path(str(scene_path))
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr[model.body("peg").jntadr[0]] + 2] = 50.0
    return model, data, OwnBody(model, 7, 0)


def names(shapes):
    return [(shapes.robot[i].name, shapes.robot[j].name) for i, j in self_pairs(shapes.robot)]


def test_the_default_arm_has_exactly_its_thirty_five_pairs(scene_path):
    shapes = shapes_of(scene_path, joints=7)
    tool = {(name, link) for name in TOOL for link in LINKS[: 8 - APART]}
    assert set(names(shapes)) == PAIRS | tool
    assert len(names(shapes)) == 15 + 20


def test_the_forearm_folded_onto_the_base_is_seen(scene_path):
    """Random postures within the joint ranges, against MuJoCo's contacts of the same pairs.

    Only tool and links were held against each other once: a forearm in the base was free.
    """
    arm = ArmKinematics(scene_path)
    model, data, own = mujoco_of(scene_path)
    collision, scene = CollisionModel(scene_path, arm), SceneState()
    rng, found = np.random.default_rng(5), set()
    for q in rng.uniform(arm.lower_rad, arm.upper_rad, (1500, 7)):
        data.qpos[:7] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        deep = {
            tuple(sorted(model.geom(g).name for g in data.contact.geom[i]))
            for i in range(data.ncon)
            if data.contact.dist[i] < -1e-5 and not own.may_meet(*data.contact.geom[i])
        }
        deep = {pair for pair in deep if set(pair) <= {*LINKS, *TOOL}}
        hit = collision.in_collision(q, scene, opening_m=0.0, held=False)
        assert hit is not None or not deep, deep
        found |= deep
    assert {("link0", "link5"), ("link0", "link6"), ("link0", "link7")} <= found


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


def test_without_a_tool_the_links_are_left(scene_path):
    shapes = shapes_of(scene_path, joints=7)
    bare = tuple(shape for shape in shapes.robot if not shape.tool)
    assert {(bare[i].name, bare[j].name) for i, j in self_pairs(bare)} == PAIRS


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
