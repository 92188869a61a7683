"""Kernels of kinematics against Pinocchio and numpy."""

import numpy as np
import pinocchio as pin
import pytest

from genpolicy.feasibility.kernels.arm import jacobian, place, pose_error, solve_all, step_along

FIGURES = np.array([1e-3, 0.5, 1e-7, 1e-7])


def placed(cell, q):
    arm, places = cell.kinematics, cell.joint_count + 1
    rotation, position = np.empty((places, 3, 3)), np.empty((places, 3))
    place(arm.turns, arm.offsets, q, rotation, position)
    return rotation, position


def test_frames_and_jacobian_are_those_of_pinocchio(cell):
    arm, rng = cell.kinematics, np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(arm.lower_rad, arm.upper_rad)
        whole = pin.neutral(arm.model)
        whole[: len(q)] = q
        pin.computeJointJacobians(arm.model, arm.data, whole)
        pin.updateFramePlacements(arm.model, arm.data)
        rotation, position = placed(cell, q)
        tcp = arm.data.oMf[arm.tcp_frame_id]
        assert np.allclose(rotation[-1], tcp.rotation, atol=1e-12)
        assert np.allclose(position[-1], tcp.translation, atol=1e-12)
        rows = np.empty((6, len(q)))
        jacobian(rotation, position, rows)
        expected = pin.getFrameJacobian(
            arm.model, arm.data, arm.tcp_frame_id, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        assert np.allclose(rows, expected[:, : len(q)], atol=1e-12)


def test_a_step_is_damped_least_squares_and_no_joint_leaps():
    rng = np.random.default_rng(1)
    rows, error = rng.normal(0, 1, (6, 7)), rng.normal(0, 0.1, 6)
    step, room = np.empty(7), np.empty((6, 6))
    step_along(rows, error, 0.1, 9.0, room, step)
    expected = rows.T @ np.linalg.solve(rows @ rows.T + 0.01 * np.eye(6), error)
    assert np.allclose(step, expected, atol=1e-12)
    most = np.max(np.abs(expected)) / 2
    step_along(rows, error, 0.1, most, room, step)
    assert np.allclose(step, expected / 2, atol=1e-12)


def test_the_error_of_a_pose_is_its_rotation_vector_and_none_at_the_pose():
    turn = pin.exp3(np.array([0.1, -0.2, 0.3]))
    error, at = np.empty(6), np.array([1.0, 2.0, 3.0])
    pose_error(np.eye(3), at, at + np.array([0.0, 0.0, 0.5]), turn, error)
    assert np.allclose(error, [0, 0, 0.5, 0.1, -0.2, 0.3], atol=1e-12)
    pose_error(turn, at, at, turn, error)
    assert np.allclose(error, 0, atol=1e-12)
    pose_error(np.eye(3), at, at, np.diag([1.0, -1.0, -1.0]), error)
    assert error[3:].tolist() == [0.5, 0.5, 0.5]  # the axis of a half turn is lost


@pytest.mark.parametrize("iterations", [0, 2, 40])
def test_the_solver_takes_so_many_steps_and_says_what_is_left(cell, kit, iterations):
    arm, q = cell.kinematics, kit.HOME[None] + 0.3
    rotation, position = placed(cell, kit.HOME)
    left = np.empty((1, 2))
    target = position[-1:].copy(), rotation[-1:].copy()
    solve_all(arm.turns, arm.offsets, *target, q, iterations, FIGURES, left)
    reached, at = placed(cell, q[0])
    assert left[0, 0] == pytest.approx(np.linalg.norm(at[-1] - target[0][0]), abs=1e-12)
    assert (left.max() <= 1e-7) == (iterations == 40)
    assert np.allclose(reached[-1], target[1][0], atol=1e-6) == (iterations == 40)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("part", ["position", "rotation", "seed"])
def test_of_a_pose_that_is_none_nothing_is_known_and_the_others_are_solved(cell, kit, part, bad):
    """Neither distance nor angle, whatever stood there before; the seed stays as it was."""
    arm, rows = cell.kinematics, 3
    rotation, position = placed(cell, kit.HOME)
    asked = {
        "position": np.tile(position[-1], (rows, 1)),
        "rotation": np.tile(rotation[-1], (rows, 1, 1)),
        "seed": np.tile(kit.HOME + 0.1, (rows, 1)),
    }
    asked[part][1].flat[0] = bad
    seed, left = asked["seed"].copy(), np.full((rows, 2), 7.0)
    solve_all(arm.turns, arm.offsets, *asked.values(), 40, FIGURES, left)
    assert np.isnan(left[1]).tolist() == [True, True]
    assert np.array_equal(asked["seed"][1], seed[1], equal_nan=True)
    assert left[[0, 2]].max() <= 1e-7
