import mujoco
import numpy as np
import pytest

from genpolicy.errors import NonFiniteError
from genpolicy.robot.impedance import (
    DAMPING_N_S_M,
    STIFFNESS_N_M,
    ImpedanceController,
)
from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion.plans import travel
from genpolicy.tasks.tabletop_insertion.scene import POSTURE_RAD
from genpolicy.tasks.tabletop_insertion.start import sample_start
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld


@pytest.fixture
def world():
    return TabletopWorld(sample_start(stream(1, "control")), settings=WorldSettings("epoch_1"))


def follow(world, path):
    action = world.last_action
    errors = []
    for position in path:
        action[:3] = position
        world.command(action)
        world.advance()
        errors.append(np.linalg.norm(world.tcp_pose[0] - position))
    return np.array(errors)


@pytest.mark.parametrize("move", [(0.0, 0.2, 0.04), (0.05, -0.15, 0.0), (0.0, 0.15, -0.03)])
def test_tracks_a_free_motion_to_two_millimetres(world, move):
    begin = world.last_action[:3]
    path = travel(np.array([begin, begin + move]), speed_m_s=0.20, acceleration_m_s2=0.7)
    assert follow(world, path).max() < 0.002


def test_a_constant_push_moves_the_tcp_like_a_spring(world):
    # Golden: Hooke, 25 N / 2500 N/m = 10 mm; the posture torque is in the null space.
    begin = world.tcp_pose[0]
    world.apply_force(np.array([0.0, 25.0, 0.0]), 10.0)
    follow(world, np.repeat(begin[None], 40, axis=0))
    displacement = world.tcp_pose[0] - begin
    assert displacement[1] == pytest.approx(25.0 / STIFFNESS_N_M, rel=0.05)
    assert np.abs(displacement[[0, 2]]).max() < 0.002


def effective_inertia(model, data, *, site, joints):
    """Inertia that the TCP opposes to a force: (J M^-1 J^T)^-1, kg and kg m2. Shape (6, 6)."""
    jacobian = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], int(model.site(site).id))
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    arm = slice(0, joints)
    return np.linalg.inv(jacobian[:, arm] @ np.linalg.solve(full[arm, arm], jacobian[:, arm].T))


def test_damping_ratio_is_about_one(world):
    inertia = np.diag(effective_inertia(world.model, world.data, site="tcp", joints=7))[:3]
    ratio = DAMPING_N_S_M / (2.0 * np.sqrt(STIFFNESS_N_M * inertia))
    assert ((ratio > 0.7) & (ratio < 1.5)).all()


def test_stands_still_under_gravity(world):
    begin = world.tcp_pose[0]
    follow(world, np.repeat(world.last_action[None, :3], 20, axis=0))
    assert np.linalg.norm(world.tcp_pose[0] - begin) < 1e-4
    assert np.abs(world.data.qvel[:7]).max() < 1e-3


@pytest.fixture
def bare(world):
    controller = ImpedanceController(world.model, world.data, site="tcp", posture_rad=POSTURE_RAD)
    mujoco.mj_step1(world.model, world.data)
    return world, controller


def test_torques_inside_the_limits_are_left_alone(bare):
    world, controller = bare
    position, rotation = world.tcp_pose
    controller.step(position, rotation, np.zeros(6))
    limit = world.model.actuator_ctrlrange[:7, 1]
    assert (np.abs(world.data.ctrl[:7]) < limit - 1.0).all()


def test_torques_outside_the_limits_are_cut_to_them(bare):
    world, controller = bare
    position, rotation = world.tcp_pose
    controller.step(position, rotation, np.full(6, -100.0))
    limit = world.model.actuator_ctrlrange[:7, 1]
    assert (np.abs(world.data.ctrl[:7]) <= limit).all()
    assert (np.abs(world.data.ctrl[:7]) == limit).any()


def test_a_far_target_pulls_no_harder_than_the_saturated_error(bare):
    world, controller = bare
    position, rotation = world.tcp_pose
    torques = []
    for distance_m in (0.1, 10.0):
        controller.reset()
        controller.step(position + np.array([0.0, distance_m, 0.0]), rotation, np.zeros(6))
        torques.append(world.data.ctrl[:7].copy())
    np.testing.assert_array_equal(*torques)


def test_posture_torque_exerts_no_force_at_the_tcp(bare):
    world, controller = bare
    position, rotation = world.tcp_pose
    controller.step(position, rotation, np.zeros(6))
    jacobian = controller._jacobian
    np.testing.assert_allclose(jacobian @ controller._projector, 0.0, atol=1e-6)
    assert np.trace(controller._projector) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    "fault", [{0: np.nan}, {9: np.inf}, {3: 0.0, 4: 0.0, 5: 0.0}], ids=["nan", "inf", "rotation"]
)
def test_refuses_a_target_that_is_none(world, fault):
    action = world.last_action
    before = world.state_sha256()
    for index, value in fault.items():
        action[index] = value
    with pytest.raises(NonFiniteError, match="Reject the whole chunk and hold"):
        world.command(action)
    assert world.state_sha256() == before
