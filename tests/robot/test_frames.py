"""What follows from placed frames alone: the way to a pose, and the Jacobian."""

import numpy as np
from scipy.spatial.transform import Rotation

from genpolicy.robot.frames import Frames, jacobian_of, pose_error


def placed(rng, rows=16, joints=4):
    turns = Rotation.random(rows * (joints + 1), random_state=rng.integers(1 << 31))
    rotation = turns.as_matrix().reshape(rows, joints + 1, 3, 3)
    return Frames(rotation, rng.normal(size=(rows, joints + 1, 3)))


def test_the_error_is_the_way_from_the_tcp_to_the_pose(rng) -> None:
    frames = placed(rng)
    way = rng.uniform(-1.0, 1.0, size=(16, 6))
    rotation = Rotation.from_rotvec(way[:, 3:]).as_matrix() @ frames.rotation[:, -1]
    error = pose_error(frames, frames.position_m[:, -1] + way[:, :3], rotation)
    np.testing.assert_allclose(error, way, atol=1e-12)


def test_a_half_turn_is_pushed_off_its_lost_axis(rng) -> None:
    frames = placed(rng, rows=1)
    half = np.diag([1.0, -1.0, -1.0]) @ frames.rotation[:, -1]
    error = pose_error(frames, frames.position_m[:, -1], half)
    assert np.linalg.norm(error[0, 3:]) > 0.5


def test_a_joint_turns_the_tcp_about_its_own_axis(rng) -> None:
    frames = placed(rng)
    jacobian = jacobian_of(frames)
    axes = frames.rotation[:, :-1, :, 2]
    arms = frames.position_m[:, -1:] - frames.position_m[:, :-1]
    np.testing.assert_allclose(jacobian[:, 3:], axes.transpose(0, 2, 1))
    np.testing.assert_allclose(jacobian[:, :3], np.cross(axes, arms).transpose(0, 2, 1))
