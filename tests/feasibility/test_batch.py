"""Several chunks as the layers see them: seams, openings, who still holds, and parts of it."""

import numpy as np
import pytest

from genpolicy.contract.action import GRIPPER, POSITION
from genpolicy.feasibility.batch import Solution


@pytest.fixture(scope="module")
def two(kit, checker):
    """A chunk forward with a closed hand, and one that opens at row 5."""
    opening = np.where(np.arange(16) >= 5, 0.03, 0.0)
    still = kit.context(checker, kit.START)
    ahead = kit.line(kit.START, (0.40, 0.0, 0.15))
    opens = kit.line(kit.START, kit.SIDE, opening=opening)
    return (ahead, still), (opens, kit.context(checker, kit.START, phase="insert"))


def test_steps_begin_at_the_last_command(kit, two):
    batch = kit.batch_of(*two)
    assert len(batch) == 2 and batch.steps_m.shape == (2, 16, 3)
    ahead, still = two[0]
    np.testing.assert_allclose(batch.steps_m[0, 0], ahead[0, :3] - still.last_action[:3])
    np.testing.assert_allclose(
        still.last_action[POSITION] + batch.steps_m[0].sum(axis=0), ahead[-1, POSITION]
    )


def test_what_was_let_go_once_is_not_held_again(kit, checker):
    opening = np.zeros(16)
    opening[4] = 0.03
    chunk = (kit.line(kit.START, kit.SIDE, opening=opening), kit.context(checker, kit.START))
    batch = kit.batch_of(chunk)
    assert batch.openings_m.shape == (1, 17) and batch.openings_m[0, 5] == 0.03
    assert batch.held(0.01)[0].tolist() == [True] * 5 + [False] * 12
    assert batch.held(0.03).all()


def test_only_rows_that_can_be_executed_are_seen(kit, checker):
    ctx = kit.context(checker, kit.START, first_index=3)
    actions = kit.line(kit.START, kit.SIDE)
    batch = kit.batch_of((actions, ctx))
    np.testing.assert_array_equal(batch.actions[0], actions[3:])
    assert batch.rotation.shape == (1, 13, 3, 3)
    np.testing.assert_allclose(batch.rotation[0], np.broadcast_to(kit.DOWN, (13, 3, 3)), atol=1e-12)


def test_phases_and_parts_of_a_batch_stay_together(kit, two):
    batch = kit.batch_of(*two)
    assert batch.in_phases(frozenset({"insert"})).tolist() == [False, True]
    assert batch.take([0, 1]) is batch
    second = batch.take([1])
    assert second.in_phases(frozenset({"insert"})).tolist() == [True]
    np.testing.assert_array_equal(second.actions[0], batch.actions[1])
    assert second.actions[0, -1, GRIPPER] == 0.03


def test_a_part_takes_its_own_solution_and_nobody_reads_one_that_is_not_there(kit, two):
    batch = kit.batch_of(*two)
    with pytest.raises(AssertionError, match="comes before"):
        _ = batch.solved
    found = Solution(np.arange(2.0)[:, None, None], np.arange(2.0)[:, None], np.zeros((2, 1)))
    object.__setattr__(batch, "solution", found)
    assert batch.take([1]).solved.q_rad.ravel().tolist() == [1.0]
    assert batch.take([1]).solved.position_error_m.ravel().tolist() == [1.0]
