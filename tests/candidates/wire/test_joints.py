"""Joint positions become poses by the robot's own kinematics: held to MuJoCo and Pinocchio."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from genpolicy.candidates.wire.entry import Output
from genpolicy.candidates.wire.mapping import Outputs
from genpolicy.contract.action import split_action
from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.errors import ContractError
from genpolicy.tasks.api import load_task

TASK = load_task("tabletop_insertion")
SCENE = TASK.scene_path
JOINTS = 7
CONTRACT = ObservationContract((
    Channel("place_m", ("x", "y", "z"), "m", "robot", 0.1),
    Channel("q_rad", tuple("abcdefg"), "rad", "robot", 0.1),
    Channel("q_deg", tuple("abcdefg"), "deg", "robot", 0.1),
))  # fmt: skip
TOLERANCE = 1e-9
angles = st.lists(st.floats(-2.8, 2.8), min_size=JOINTS, max_size=JOINTS)


def output(*, unit="rad", motion="absolute", columns=range(JOINTS), anchor="q_rad"):
    return Output.model_validate({
        "motion": motion,
        "joints": {"columns": list(columns), "unit": unit},
        "gripper": {"column": JOINTS, "open": 1.0, "open_m": 0.04},
        "anchor": None if motion == "absolute" else {"joints": [anchor]},
    })  # fmt: skip


def seen(q_rad):
    return np.concatenate([[1.0, 2.0, 3.0], q_rad, np.degrees(q_rad)])


def mapped(declared, chunks, q_rad=None):
    at = np.zeros(JOINTS) if q_rad is None else q_rad
    return Outputs(declared, CONTRACT, scene=SCENE).mapped(chunks, seen(at))


def of_mujoco(q_rad):
    """Pose of the site in MuJoCo's own kinematics: the joints before it, all others as they are."""
    model = mujoco.MjModel.from_xml_path(str(SCENE))
    data = mujoco.MjData(model)
    data.qpos[:JOINTS] = q_rad
    mujoco.mj_kinematics(model, data)
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "tcp")
    return data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()


def of_pinocchio(q_rad):
    model = pin.buildModelFromMJCF(str(SCENE))
    data = model.createData()
    whole = pin.neutral(model)
    whole[:JOINTS] = q_rad
    pin.framesForwardKinematics(model, data, whole)
    place = data.oMf[model.getFrameId("tcp")]
    return place.translation, place.rotation


@pytest.mark.parametrize("oracle", [of_mujoco, of_pinocchio])
@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_a_configuration_is_the_pose_that_others_compute(oracle, unit):
    configurations = np.random.default_rng(3).uniform(-2.5, 2.5, (2, 4, JOINTS))
    said = np.degrees(configurations) if unit == "deg" else configurations
    chunks = np.concatenate([said, np.full((2, 4, 1), 0.5)], axis=-1)
    place, turned, opened = split_action(mapped(output(unit=unit), chunks))
    for index in np.ndindex(2, 4):
        at, towards = oracle(configurations[index])
        np.testing.assert_allclose(place[index], at, atol=TOLERANCE)
        np.testing.assert_allclose(turned[index], towards, atol=TOLERANCE)
    np.testing.assert_allclose(opened, 0.02)


@given(angles, angles, angles)
def test_relative_motions_are_the_absolute_one_that_they_were_made_of(anchor, first, second):
    at = np.array(anchor)
    path = np.array([[first, second]])
    grip = np.ones((1, 2, 1))
    absolute = mapped(output(), np.concatenate([path, grip], axis=-1))
    relative = np.concatenate([path - at, grip], axis=-1)
    steps = np.diff(np.concatenate([np.broadcast_to(at, (1, 1, JOINTS)), path], axis=1), axis=1)
    increments = np.concatenate([steps, grip], axis=-1)
    for declared, chunks in (
        (output(motion="relative"), relative),
        (output(motion="increments"), increments),
        (output(motion="relative", anchor="q_deg"), relative),
        (output(motion="increments", unit="deg"), increments * [*[180 / np.pi] * JOINTS, 1.0]),
    ):
        np.testing.assert_allclose(mapped(declared, chunks, at), absolute, atol=TOLERANCE)


def test_columns_may_stand_in_any_order():
    q = np.random.default_rng(0).uniform(-1, 1, JOINTS)
    order = [3, 0, 6, 1, 2, 5, 4]
    chunk = np.ones((1, 1, JOINTS + 1))
    chunk[..., order] = q
    straight = np.concatenate([q, [1.0]])[None, None]
    np.testing.assert_array_equal(mapped(output(columns=order), chunk), mapped(output(), straight))


def test_a_joint_that_is_no_number_spoils_its_row_and_no_other():
    chunk = np.zeros((1, 3, JOINTS + 1))
    chunk[0, 1, 2] = np.nan
    finite = np.isfinite(mapped(output(), chunk)).all(axis=2)
    np.testing.assert_array_equal(finite, [[True, False, True]])


def test_another_number_of_joints_is_refused_with_both():
    for columns in (range(6), range(8, 16)):
        with pytest.raises(ContractError) as error:
            Outputs(output(columns=columns), CONTRACT, scene=SCENE)
        assert error.value.found == f"{len(columns)} joints"
        assert error.value.expected.startswith("7, as the arm of")


def test_an_observation_without_measured_joints_is_named_with_what_it_has():
    """As that of the task: joints are measured there, and no policy sees them."""
    with pytest.raises(ContractError) as error:
        Outputs(output(motion="relative"), TASK.observation, scene=SCENE)
    assert error.value.found == "'q_rad'" and "tcp_position_m" in error.value.expected
    assert error.value.where == "action.anchor.joints of the candidate"


@pytest.mark.parametrize(("anchor", "told"), [
    ("place_m", "3 joints.*expected 7"), ("place_m.x", "1 joints.*expected 7"),
])  # fmt: skip
def test_an_anchor_of_another_size_is_refused(anchor, told):
    with pytest.raises(ContractError, match=told):
        Outputs(output(motion="increments", anchor=anchor), CONTRACT, scene=SCENE)


def test_an_anchor_that_is_no_angle_is_refused():
    metres = ObservationContract((Channel("q_m", tuple("abcdefg"), "m", "robot", 0.1),))
    with pytest.raises(ContractError, match="numbers in m, expected joint positions"):
        Outputs(output(motion="relative", anchor="q_m"), metres, scene=SCENE)


def test_where_nobody_knows_the_robot_joints_are_refused():
    with pytest.raises(ContractError, match="data of no registered task"):
        Outputs(output(), CONTRACT)
