"""The scene file: one geometry for both libraries, variants, and poses that can be reached."""

import mujoco
import numpy as np
import pinocchio
import pytest

from genpolicy.errors import ContractError
from genpolicy.seeds import stream
from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.start import RANGES


def test_mujoco_and_pinocchio_agree_on_every_arm_frame():
    model = mujoco.MjModel.from_xml_path(str(scene.SCENE_PATH))
    data = mujoco.MjData(model)
    other = pinocchio.buildModelFromMJCF(str(scene.SCENE_PATH))
    other_data = other.createData()
    assert other.nq == 9
    rng = stream(3, "kinematics")
    lower, upper = model.jnt_range[:9].T
    names = ["link1", "link4", "link7", "hand", "left_finger"]
    for _ in range(50):
        q = rng.uniform(lower, upper)
        data.qpos[:9] = q
        mujoco.mj_kinematics(model, data)
        pinocchio.framesForwardKinematics(other, other_data, q)
        for name in names:
            frame = other_data.oMf[other.getFrameId(name, pinocchio.FrameType.BODY)]
            np.testing.assert_allclose(frame.translation, data.body(name).xpos, atol=1e-9)
            np.testing.assert_allclose(
                frame.rotation, data.body(name).xmat.reshape(3, 3), atol=1e-9
            )
        tcp = other_data.oMf[other.getFrameId("tcp")]
        np.testing.assert_allclose(tcp.translation, data.site("tcp").xpos, atol=1e-9)


def test_constants_are_those_of_the_scene():
    model = scene.load_model()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    post = model.geom("post")
    assert 2 * post.size[1] == pytest.approx(scene.POST_HEIGHT_M)
    assert data.body("post").xpos[0] == scene.POST_X_M
    assert data.site("target").xpos[2] == pytest.approx(scene.FIXTURE_TOP_M)
    assert data.body("fixture").xpos[0] == RANGES["hole_x_m"][0]
    assert model.geom("peg").size[2] == scene.PEG_HALF_LENGTH_M


def test_a_variant_changes_what_it_names_only():
    plain, wide = scene.load_model(), scene.load_model(scene.Variant(peg_width_scale=1.1))
    assert wide.geom("peg").size[0] == pytest.approx(1.1 * plain.geom("peg").size[0])
    assert wide.geom("post").size[0] == plain.geom("post").size[0]
    np.testing.assert_array_equal(wide.body_pos, plain.body_pos)


def test_inverse_kinematics_reaches_the_pose():
    model = scene.load_model()
    data = mujoco.MjData(model)
    position, rotation = np.array([0.6, 0.1, 0.12]), scene.tool_rotation(0.2)
    data.qpos[:7] = scene.solve_arm(model, position, rotation)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(data.site("tcp").xpos, position, atol=1e-10)
    np.testing.assert_allclose(data.site("tcp").xmat.reshape(3, 3), rotation, atol=1e-10)


def test_an_unreachable_start_is_refused():
    with pytest.raises(ContractError, match="a pose that the arm reaches"):
        scene.solve_arm(scene.load_model(), np.array([1.6, 0.0, 0.1]), scene.tool_rotation(0.0))
