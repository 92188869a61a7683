"""Inverse dynamics of the arm: ours, Pinocchio's and MuJoCo's are one."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from genpolicy.robot.dynamics import ArmDynamics
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.payload import payload_of
from genpolicy.tasks.api import load_task
from genpolicy.verification.body import Driven


@pytest.fixture(scope="module")
def scene():
    return load_task("tabletop_insertion").scene_path


@pytest.fixture(scope="module")
def arm(scene):
    return ArmKinematics(scene)


@pytest.fixture(scope="module")
def motion(arm):
    rng = np.random.default_rng(3)
    joints = len(arm.lower_rad)
    q = rng.uniform(arm.lower_rad, arm.upper_rad, (20, joints))
    return q, rng.normal(size=(20, joints)), 8.0 * rng.normal(size=(20, joints))


def test_it_is_what_mujoco_says(arm, scene, motion):
    """Fingers closed: what MuJoCo would have to drive the arm with, nothing touching."""
    model = mujoco.MjModel.from_xml_path(str(scene))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    found = ArmDynamics(arm).torque(*motion)
    for q, dq, ddq, torque in zip(*motion, found, strict=True):
        data.qpos[:7], data.qvel[:7], data.qacc[:7] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(torque, data.qfrc_inverse[:7], atol=1e-8)


def test_what_the_hand_holds_weighs_as_mujoco_says(arm, scene, motion):
    """A twin of the held object, grown to the hand in MuJoCo's own model."""
    load = payload_of(scene, joints=7)
    assert load.mass_kg == 0.05 and load.joint == 6
    empty, full = ArmDynamics(arm).torque(*motion), ArmDynamics(arm, load).torque(*motion)
    expected = [Driven(scene, 7, held=True).torque_nm(*row) for row in zip(*motion, strict=True)]
    np.testing.assert_allclose(full, np.stack(expected), atol=1e-7)
    assert np.max(np.abs(full - empty)) > 0.1


def test_it_is_what_pinocchio_says(arm, motion):
    model, data = arm.model, arm.model.createData()
    found = ArmDynamics(arm).torque(*motion)
    for row, torque in zip(zip(*motion, strict=True), found, strict=True):
        q, dq, ddq = (np.concatenate([value, np.zeros(model.nv - 7)]) for value in row)
        expected = pin.rnea(model, data, q, dq, ddq)[:7] + model.damping[:7] * dq[:7]
        np.testing.assert_allclose(torque, expected, atol=1e-9)


def test_a_row_does_not_depend_on_the_others(arm, motion):
    dynamics = ArmDynamics(arm)
    together = dynamics.torque(*motion)
    alone = dynamics.torque(*(value[4:5] for value in motion))
    np.testing.assert_allclose(together[4:5], alone, rtol=1e-12, atol=1e-12)


def test_standing_still_it_carries_its_weight(arm):
    """Stretched out sideways the shoulder holds the arm's mass times its lever."""
    q = np.array([[0.0, np.pi / 2, 0.0, -0.0698, 0.0, np.pi / 2, 0.0]])
    torque = ArmDynamics(arm).torque(q, np.zeros((1, 7)), np.zeros((1, 7)))
    assert abs(torque[0, 0]) < 1e-9  # about the vertical nothing is carried
    assert 30.0 < abs(torque[0, 1]) < 87.0
