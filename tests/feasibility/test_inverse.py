"""Inverse kinematics of whole chunks: poses reached, chunks apart, hopeless ones cheap."""

from dataclasses import replace

import numpy as np

from genpolicy.contract.action import POSITION
from genpolicy.feasibility.inverse import solve_chunks, solved


class Counting:
    """The arm, with its restarts counted by row."""

    def __init__(self, arm):
        self.arm, self.rows = arm, []

    def __getattr__(self, name):
        return getattr(self.arm, name)

    def solve_with_restarts(self, position_m, rotation, *, q_seed_rad):
        self.rows.append(len(position_m))
        return self.arm.solve_with_restarts(position_m, rotation, q_seed_rad=q_seed_rad)


def test_the_solution_reaches_every_pose_from_the_last_command_on(kit, checker, cell):
    chunk = kit.line(kit.START, kit.SIDE)
    batch = solved(kit.batch_of((chunk, kit.context(checker, kit.START))), cell)
    q = batch.solved.q_rad[0]
    position, rotation = cell.kinematics.forward(q)
    np.testing.assert_allclose(position, chunk[:, POSITION], atol=1e-5)
    np.testing.assert_allclose(rotation, np.broadcast_to(kit.DOWN, (16, 3, 3)), atol=1e-4)
    # Rows of one motion are near each other, and the first is near the last command.
    path = np.vstack([batch.q_cmd_rad[0], q])
    assert np.abs(np.diff(path, axis=0)).max() < 0.1


def test_a_chunk_does_not_depend_on_its_company(kit, checker, cell):
    good = (kit.line(kit.START, kit.SIDE), kit.context(checker, kit.START))
    far = (kit.line(kit.START, (2.0, 0.0, 0.15)), kit.context(checker, kit.START))
    alone = solved(kit.batch_of(good), cell).solved
    beside = solved(kit.batch_of(far, good), cell).solved
    np.testing.assert_array_equal(alone.q_rad[0], beside.q_rad[1])
    assert beside.position_error_m[0, -1] > 0.5 and alone.position_error_m.max() < 1e-5


def test_a_hopeless_chunk_costs_the_restarts_of_one_row(kit, checker, cell):
    far = kit.line((2.0, 0.0, 0.15), (2.1, 0.0, 0.15))
    batch = kit.batch_of((far, kit.context(checker, kit.START)))
    arm = Counting(cell.kinematics)
    found = solve_chunks(
        arm, batch.actions[..., POSITION], batch.rotation, q_start_rad=batch.q_cmd_rad
    )
    assert arm.rows == [1]
    assert found.q_rad.shape == (1, 16, 7) and (found.position_error_m > 0.5).all()


def test_a_chunk_that_only_fails_from_its_seed_is_tried_again_whole(kit, checker, cell):
    chunk = kit.line(kit.START, kit.SIDE)
    batch = kit.batch_of((chunk, kit.context(checker, kit.START)))
    arm = Counting(cell.kinematics)
    backwards = np.array([[2.8, 1.7, 2.8, -0.1, 2.8, 3.7, 2.8]])
    found = solve_chunks(arm, batch.actions[..., POSITION], batch.rotation, q_start_rad=backwards)
    assert found.position_error_m.max() < 1e-5
    assert cell.kinematics.within_limits(found.q_rad).all()
    assert replace(batch, solution=found).solved is found
