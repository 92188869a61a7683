"""The arm of a window goes where it is commanded to, where a task's observation allows that."""

from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.execution.command import Command
from genpolicy.wall_clock.following import FollowingArm, RecordedArm, arm_of, place, pose_columns
from genpolicy.wall_clock.replay import Replay

DIM, ACTIONS, HORIZON, ROWS = 12, 10, 4, 6
ORDER = [3, 1, 2, 0, 4, 5, 6, 7, 8, 11]


def toy(action_at=lambda seen: seen[ORDER]):
    """A task of which only the arm is known."""
    return SimpleNamespace(observation=SimpleNamespace(dim=DIM), action_at=action_at)


@pytest.fixture
def replay():
    return Replay(
        episode_uuid="e", calibration_epoch="c", phases=("approach",) * ROWS,
        observations=tuple(tuple(100.0 * row + n for n in range(DIM)) for row in range(ROWS)),
        actions=tuple((float(row),) * ACTIONS for row in range(ROWS)), forces_n=(0.0,) * ROWS,
    )  # fmt: skip


@pytest.fixture
def arm(replay):
    return arm_of(toy(), replay, horizon=HORIZON)


def command(value, chunk="c", row=0):
    return Command("action", "", np.full(ACTIONS, float(value)), chunk, row)


def of_arm(seen):
    return seen[..., ORDER]


def rest_of(seen):
    return np.delete(seen, ORDER, axis=-1).tolist()


def test_the_columns_of_the_task_are_found_and_placed_bit_for_bit(task):
    columns = pose_columns(task)
    generator = np.random.default_rng(3)
    for _ in range(20):
        seen = generator.normal(size=task.observation.dim)
        action = generator.normal(size=ACTIONS)
        placed = place(seen, action, columns)
        assert task.action_at(placed).tobytes() == action.tobytes()
        assert place(seen, task.action_at(seen), columns).tobytes() == seen.tobytes()
        assert (placed != seen).sum() == ACTIONS


def raises(seen):
    raise ValueError("no such arm")


@pytest.mark.parametrize("action_at", [
    raises, lambda seen: 2.0 * seen[ORDER], lambda seen: np.append(seen[ORDER[:9]], 11.0),
    lambda seen: seen[[0] * 2 + ORDER[2:]], lambda seen: seen[ORDER[:9]], lambda seen: seen,
    lambda seen: np.floor(seen[ORDER]), lambda seen: np.full(ACTIONS, np.nan),
    lambda seen: seen[ORDER] + DIM, lambda seen: "nothing",
])  # fmt: skip
def test_a_task_whose_action_is_no_selection_keeps_the_recorded_arm(action_at, replay):
    arm = arm_of(toy(action_at), replay, horizon=HORIZON)
    assert isinstance(arm, RecordedArm) and not arm.follows
    arm.reach(1)
    arm.given(1, command(7))
    assert arm.at(2).tolist() == list(replay.observations[2])
    assert arm.history(2, 2).tolist() == replay.history(2, 2).tolist()
    assert arm.commanded(2, 3).tolist() == replay.commanded(2).tolist()


def test_before_the_first_command_it_stands_where_the_window_begins(arm, replay):
    assert isinstance(arm, FollowingArm)
    for row in range(3):
        arm.reach(row)
        arm.given(row, Command("hold", "empty"))
    history = arm.history(2, 3)
    assert (of_arm(history) == of_arm(replay.observation_rows[0])).all()
    assert rest_of(history) == rest_of(replay.observation_rows[:3])
    assert (arm.commanded(0, 3) == of_arm(replay.observation_rows[0])).all()


def test_what_is_accepted_is_seen_at_the_next_row_and_stays_while_it_holds(arm, replay):
    for row, told in enumerate([command(7), command(8), Command("hold", "empty")]):
        arm.reach(row)
        arm.given(row, told)
    arm.reach(3)
    assert of_arm(arm.at(0)).tolist() == of_arm(replay.observation_rows[0]).tolist()
    assert [of_arm(arm.at(row))[0] for row in (1, 2, 3)] == [7, 8, 8]
    assert rest_of(arm.at(3)) == rest_of(replay.observation_rows[3])
    assert arm.commanded(0, 3)[:, 0].tolist() == [7, 8, 8]


def test_rows_without_a_tick_are_held(arm):
    arm.reach(0)
    arm.given(0, command(7))
    arm.reach(3)
    arm.given(3, command(8))
    assert [of_arm(arm.at(row))[0] for row in (1, 2, 3, 4 - 1)] == [7, 7, 7, 7]
    assert arm.commanded(0, 4)[:, 0].tolist() == [7, 7, 8]


@pytest.mark.parametrize(
    ("running", "last", "first", "told"),
    [
        ("c", command(7, row=1), 1, [0, 0, 7]),
        ("c", command(7, row=1), 2, [0, 7, 102]),
        ("c", command(7, row=1), 3, [7, 102, 103]),
        ("c", command(7, row=1), 5, [103, 103, 103]),  # rows behind the horizon are never commanded
        ("c", Command("hold", "empty"), 3, [0, 0, 0]),
        ("another", command(7, row=1), 3, [7, 7, 7]),
    ],
)
def test_until_a_chunk_begins_the_one_that_runs_goes_on(running, last, first, told, replay):
    arm = arm_of(toy(), replay.part(0, 1), horizon=HORIZON)
    start = of_arm(replay.observation_rows[0])[0]
    arm.reach(0)
    rows = np.tile(np.arange(100.0, 106.0)[:, None], (1, ACTIONS))
    arm.runs(SimpleNamespace(metadata=SimpleNamespace(chunk_id=running), actions=rows))
    arm.given(0, last)
    found = arm.commanded(0, first)[:, 0]
    assert found.tolist() == [start if value == 0 else value for value in told]
