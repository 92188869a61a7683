"""A turn of the joints that moves no tool is found, by MuJoCo; one that moves it is not."""

import mujoco
import numpy as np
import pytest

from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.tasks.api import load_task
from genpolicy.verification.branch import jumped, strayed_rad

HOME = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785])


@pytest.fixture(scope="module")
def arm():
    path = load_task("tabletop_insertion").scene_path
    model = mujoco.MjModel.from_xml_path(str(path))
    return model, mujoco.MjData(model), int(model.site("tcp").id), ArmKinematics(path)


def strayed(arm, step):
    model, data, site, _ = arm
    return strayed_rad(model, data, site, np.stack([HOME, HOME + step]))


def test_only_what_moves_no_tool_counts(arm):
    jacobian = arm[3].jacobian(HOME[None])[0]
    *_, rows = np.linalg.svd(jacobian)
    null, moving = rows[-1], np.linalg.pinv(jacobian) @ (0.05, -0.03, 0.02, 0.1, 0.0, 0.2)
    assert np.max(np.abs(moving)) > 0.1
    assert strayed(arm, moving) < 0.05 * np.max(np.abs(moving))
    small = 0.02 * null
    assert strayed(arm, small) == pytest.approx(np.max(np.abs(small)), rel=0.02)
    assert strayed(arm, moving + small) == pytest.approx(np.max(np.abs(small)), abs=0.015)


def test_a_whole_turn_of_the_last_joint_is_all_of_it(arm):
    step = np.zeros(7)
    step[-1] = 2 * np.pi
    assert strayed(arm, step) == pytest.approx(2 * np.pi)


def test_a_jump_is_named_only_where_a_joint_turns_beyond_the_limit_and_no_motion_asks_for_it(arm):
    model, data, site, kinematics = arm
    null = np.linalg.svd(kinematics.jacobian(HOME[None])[0])[2][-1]
    step = 0.3 * null / np.max(np.abs(null))

    def rules(limit_rad):
        ends = np.stack([HOME, HOME + step])
        return [rule for rule, _ in jumped(model, data, site, ends, limit_rad)]

    assert rules(0.2) == ["P6.branch"] and rules(0.31) == []
