"""Where the arm of a window is: it goes where the stub's commands lead, one period behind them.

Scene, forces and phases are those of the recording. What an observation states of the arm are the
numbers that the task's `action_at` reads; they are replaced by the command that was in force when
the row before was ticked: an ideal tracker with one period of delay. Until the first command the
arm stands where the window begins. A task whose `action_at` is no selection of columns is not
followed: its arm is the recorded one, and the operator's commands lead it.
"""

from contextlib import suppress
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, POSITION
from genpolicy.evidence.admission_context import COMMANDS_AT_THE_BOUNDARY
from genpolicy.execution.command import Command
from genpolicy.feasibility.admission import Admitted
from genpolicy.tasks.api import Task
from genpolicy.wall_clock.replay import Replay

Array = NDArray[np.float64]
Columns = NDArray[np.intp]


class Arm(Protocol):
    """What the policy and the six layers are told of the arm.

    Attributes:
        follows: Whether it goes where the commands lead.
    """

    follows: bool

    def at(self, row: int) -> Array:
        """What is observed at a row. Shape (D_o,)."""
        ...

    def tcp_m(self, row: int) -> Array | None:
        """Where the TCP is seen at a row, m; None where nobody can tell. Shape (3,)."""
        ...

    def history(self, row: int, horizon: int, *, scene: int | None = None) -> Array:
        """The last observations up to a row; the first is repeated. Shape (horizon, D_o).

        Args:
            row: The row.
            horizon: How many.
            scene: Row whose scene they end with, where it is another one.
        """
        ...

    def commanded(self, asked: int, first: int) -> Array:
        """The last commands before the first row of a chunk that was asked for at a row.

        Those of ticks to come are what is commanded if nothing takes over. Oldest first, (n, 10).
        """
        ...

    def reach(self, row: int) -> None:
        """A row begins; in those without a tick before it the arm was held."""
        ...

    def given(self, row: int, command: Command) -> None:
        """What a tick handed on: an action, or nothing, and the controller holds."""
        ...

    def runs(self, chunk: Admitted) -> None:
        """A chunk was delivered, and commands from its first row on."""
        ...


def arm_of(task: Task, replay: Replay, *, horizon: int) -> Arm:
    """The arm of a window: one that follows, where the task's observation allows it.

    Args:
        task: Says where an observation puts the arm.
        replay: What is recorded.
        horizon: Actions of a chunk that may be executed.
    """
    columns = pose_columns(task)
    if columns is None:
        return RecordedArm(task, replay)
    return FollowingArm(task, replay, columns, horizon=horizon)


def pose_columns(task: Task) -> Columns | None:
    """The columns of an observation that `action_at` reads, in its order; None if it does more.

    Returns:
        Their numbers, shape (10,), none of them twice.
    """
    width = task.observation.dim
    try:
        numbers = np.asarray(task.action_at(np.arange(float(width)))).tolist()
        if len(set(numbers)) != ACTION_DIM or not set(numbers) <= {*range(width)}:
            return None
        columns = np.array(numbers, dtype=np.intp)
        seen, action = 1.0 / np.arange(2.0, width + 2.0), np.sqrt(np.arange(2.0, ACTION_DIM + 2.0))
        placed = place(seen, action, columns)
        read = bool(np.array_equal(task.action_at(placed), action))
        same = bool(np.array_equal(place(seen, task.action_at(seen), columns), seen))
    except Exception:  # of an observation that no world gives, a task may raise anything
        return None
    return columns if read and same else None


def place(observations: Array, actions: Array, columns: Columns) -> Array:
    """Observations (..., D_o) in which the arm is where actions (..., 10) command it to."""
    placed = np.array(observations)
    placed[..., columns] = actions
    return placed


class RecordedArm:
    """The arm is where the operator brought it, whatever is commanded; see `Arm`."""

    follows = False

    def __init__(self, task: Task, replay: Replay) -> None:
        self._task, self._replay = task, replay

    def at(self, row: int) -> Array:
        """As recorded."""
        seen: Array = self._replay.observation_rows[row]
        return seen

    def tcp_m(self, row: int) -> Array | None:
        """As the task reads what was recorded."""
        with suppress(Exception):  # whatever a task raises, the tick goes on to what stops
            found: Array = np.asarray(self._task.action_at(self.at(row)))[POSITION]
            return found
        return None

    def history(self, row: int, horizon: int, *, scene: int | None = None) -> Array:
        """As recorded."""
        return self._replay.history(row if scene is None else scene, horizon)

    def commanded(self, asked: int, first: int) -> Array:
        """The operator's, up to where it was asked for."""
        return self._replay.commanded(asked)

    def reach(self, row: int) -> None:
        """The recording goes on by itself."""

    def given(self, row: int, command: Command) -> None:
        """The recording goes on by itself."""

    def runs(self, chunk: Admitted) -> None:
        """The recording goes on by itself."""


class FollowingArm:
    """The arm goes where it is commanded to; see `Arm`.

    Args:
        task: Says where an observation puts the arm.
        replay: What is recorded.
        columns: What `pose_columns` says.
        horizon: Actions of a chunk that may be executed.
    """

    follows = True

    def __init__(self, task: Task, replay: Replay, columns: Columns, *, horizon: int) -> None:
        self._replay, self._columns, self._horizon = replay, columns, horizon
        self._running: Admitted | None = None
        self._last = Command("hold", "empty")
        start = np.asarray(task.action_at(replay.observation_rows[0]), dtype=np.float64)
        self._poses: list[Array] = [start]  # at each row, and in the end behind the last one

    def at(self, row: int) -> Array:
        """What was recorded, with the arm where it is."""
        return place(self._replay.observation_rows[row], self._pose(row), self._columns)

    def tcp_m(self, row: int) -> Array | None:
        """Where it was commanded to one period before."""
        return self._pose(row)[POSITION]

    def history(self, row: int, horizon: int, *, scene: int | None = None) -> Array:
        """What was recorded, with the arm where it was at each of these rows."""
        poses = np.stack([self._pose(each) for each in range(row - horizon + 1, row + 1)])
        recorded = self._replay.history(row if scene is None else scene, horizon)
        return place(recorded, poses, self._columns)

    def commanded(self, asked: int, first: int) -> Array:
        """Before the first command the arm's own pose; where nothing runs on, it is held."""
        known = len(self._poses) - 1  # rows whose command is known: the last pose is behind them
        poses = [*self._poses, *self._goes_on(first - known)]
        rows = range(first - COMMANDS_AT_THE_BOUNDARY, first)
        return np.stack([poses[min(max(row + 1, 0), len(poses) - 1)] for row in rows])

    def reach(self, row: int) -> None:
        """What was in force stays so."""
        self._poses += self._poses[-1:] * (row + 1 - len(self._poses))

    def given(self, row: int, command: Command) -> None:
        """It will be seen at the next row."""
        self.reach(row)
        self._poses.append(self._poses[-1] if command.action is None else np.array(command.action))
        self._last = command

    def runs(self, chunk: Admitted) -> None:
        """Its rows are what is commanded until another chunk takes over."""
        self._running = chunk

    def _goes_on(self, rows: int) -> Array:
        """What the chunk that commanded last still has for the next rows. Shape (n, 10)."""
        if self._running is None or self._running.metadata.chunk_id != self._last.chunk_id:
            return self._replay.action_rows[:0]
        begin = self._last.action_index + 1
        return self._running.actions[begin : max(begin, min(begin + rows, self._horizon))]

    def _pose(self, row: int) -> Array:
        """Where it is at a row; before the first row it stood there, and it stays at the last."""
        return self._poses[min(max(row, 0), len(self._poses) - 1)]
