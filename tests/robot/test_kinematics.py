import mujoco
import numpy as np
import pinocchio as pin
import pytest

from genpolicy.contract.rotation import angle_between
from genpolicy.errors import ConfigError
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.limits import PANDA


def random_q(arm, rng, n):
    return rng.uniform(arm.lower_rad, arm.upper_rad, (n, 7))


def full_configuration(arm, q_rad):
    full = np.array(pin.neutral(arm.model), dtype=float)
    full[: arm.joint_count] = q_rad
    return full


def reference_forward(arm, q_rad):
    """What Pinocchio says for one configuration of shape (J,): position (m), rotation."""
    pin.framesForwardKinematics(arm.model, arm.data, full_configuration(arm, q_rad))
    placement = arm.data.oMf[arm.tcp_frame_id]
    return placement.translation.copy(), placement.rotation.copy()


def reference_jacobian(arm, q_rad):
    """What Pinocchio says for one configuration; base axes at the TCP. Shape (6, J)."""
    q = full_configuration(arm, q_rad)
    frame = pin.LOCAL_WORLD_ALIGNED
    jacobian = pin.computeFrameJacobian(arm.model, arm.data, q, arm.tcp_frame_id, frame)
    return np.array(jacobian)[:, : arm.joint_count]


def test_position_limits_of_the_scene_are_the_table(arm):
    assert np.array_equal(arm.lower_rad, PANDA.position_lower_rad)
    assert np.array_equal(arm.upper_rad, PANDA.position_upper_rad)


def test_forward_equals_mujoco_and_pinocchio(arm, rng, scene_path):
    model = mujoco.MjModel.from_xml_path(str(scene_path))
    data, site = mujoco.MjData(model), model.site("tcp").id
    q = random_q(arm, rng, 300)
    position, rotation = arm.forward(q)
    for i in range(len(q)):
        data.qpos[:7] = q[i]
        mujoco.mj_kinematics(model, data)
        assert np.abs(data.site_xpos[site] - position[i]).max() < 1e-9
        assert np.abs(data.site_xmat[site].reshape(3, 3) - rotation[i]).max() < 1e-9
        reference = reference_forward(arm, q[i])
        assert np.abs(reference[0] - position[i]).max() < 1e-12
        assert np.abs(reference[1] - rotation[i]).max() < 1e-12


def test_forward_golden(arm):
    # Pinocchio 4.1.0 on this scene at the arm's ready pose; Panda flange 0.107 + TCP 0.1034 m.
    q = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
    position, rotation = arm.forward(q)
    assert np.allclose(position, [0.30689, 0.0, 0.48688], atol=2e-4)
    assert np.allclose(rotation, np.diag([1.0, -1.0, -1.0]), atol=1e-6)


def test_jacobian_against_finite_differences_and_pinocchio(arm, rng):
    q, h = random_q(arm, rng, 60), 1e-6
    jacobian = arm.jacobian(q)
    _, rotation = arm.forward(q)
    for joint in range(7):
        step = np.zeros(7)
        step[joint] = h
        (p1, r1), (p0, r0) = arm.forward(q + step), arm.forward(q - step)
        assert np.abs((p1 - p0) / (2 * h) - jacobian[:, :3, joint]).max() < 1e-7
        spin = np.einsum("nij,nkj->nik", (r1 - r0) / (2 * h), rotation)
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        assert np.abs(omega - jacobian[:, 3:, joint]).max() < 1e-7
    for i in range(len(q)):
        assert np.abs(reference_jacobian(arm, q[i]) - jacobian[i]).max() < 1e-12


def test_inverse_kinematics_round_trip(arm, rng):
    q = random_q(arm, rng, 300)
    position, rotation = arm.forward(q)
    middle = np.tile((arm.lower_rad + arm.upper_rad) / 2, (len(q), 1))
    result = arm.solve_with_restarts(position, rotation, q_seed_rad=middle)
    found = result.converged & arm.within_limits(result.q_rad)
    assert found.mean() >= 0.95, found.mean()
    again = arm.forward(result.q_rad)
    assert np.abs(again[0] - position)[found].max() < 1e-6
    assert angle_between(again[1], rotation)[found].max() < 1e-6


def test_inverse_kinematics_does_not_depend_on_the_batch(arm, rng):
    q = random_q(arm, rng, 20)
    position, rotation = arm.forward(q)
    seeds = q + rng.normal(0, 0.05, q.shape)
    together = arm.solve(position, rotation, q_seed_rad=seeds)
    for i in (0, 7, 19):
        alone = arm.solve(position[i : i + 1], rotation[i : i + 1], q_seed_rad=seeds[i : i + 1])
        assert np.abs(alone.q_rad[0] - together.q_rad[i]).max() < 1e-9


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_non_finite_pose_never_converges(arm, bad):
    position = np.array([[bad, 0.0, 0.2], [0.45, 0.0, 0.2]])
    rotation = np.tile(np.diag([1.0, -1.0, -1.0]), (2, 1, 1))
    seeds = np.tile([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785], (2, 1))
    result = arm.solve_with_restarts(position, rotation, q_seed_rad=seeds)
    assert result.converged.tolist() == [False, True]
    assert np.isnan(result.position_error_m[0])


def test_an_unreachable_pose_does_not_converge(arm):
    result = arm.solve_with_restarts(
        np.array([[1.5, 0.0, 0.2]]), np.diag([1.0, -1.0, -1.0])[None],
        q_seed_rad=np.array([[0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785]]),
    )  # fmt: skip
    assert not result.converged[0]
    assert result.position_error_m[0] > 0.1


def test_condition_number_at_a_stretched_arm(arm):
    ready = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    stretched = np.array([0.0, 0.0, 0.0, -0.0698, 0.0, 0.0698, 0.785])
    condition = arm.condition_number(np.stack([ready, stretched]))
    assert condition[0] < 30 < condition[1]
    singular = np.linalg.svd(arm.jacobian(ready[None])[0], compute_uv=False)
    assert condition[0] == pytest.approx(singular[0] / singular[-1], rel=1e-9)


@pytest.mark.parametrize("joint", ["axis='1 0 0'", "axis='0 0 1' type='slide'"])
def test_another_joint_on_the_way_to_the_tcp_is_refused(tmp_path, joint):
    scene = tmp_path / "scene.xml"
    site = "<site name='tcp'/>"
    body = f"<body name='b'><joint name='j' {joint}/><geom size='.1' mass='1'/>{site}</body>"
    scene.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    with pytest.raises(ConfigError, match="revolute joints about their own z axes"):
        ArmKinematics(scene)


def test_a_tcp_that_no_joint_moves_is_refused(tmp_path):
    scene = tmp_path / "scene.xml"
    child = "<body name='c'><joint name='j' axis='0 0 1'/><geom size='.1' mass='1'/></body>"
    body = f"<body name='b'><geom size='.1' mass='1'/><site name='tcp'/>{child}</body>"
    scene.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    with pytest.raises(ConfigError, match="frame tcp"):
        ArmKinematics(scene)


def test_a_file_that_pinocchio_refuses_is_named(tmp_path):
    scene = tmp_path / "scene.xml"
    scene.write_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(ConfigError, match=r"scene\.xml is refused by Pinocchio"):
        ArmKinematics(scene)


def test_a_missing_frame_is_refused(scene_path):
    with pytest.raises(ConfigError, match="frame nowhere"):
        ArmKinematics(scene_path, tcp_frame="nowhere")
