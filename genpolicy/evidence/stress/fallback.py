"""The primitive of the fallback in a rollout: planned once, from where it begins."""

import numpy as np
from numpy.typing import NDArray

from genpolicy.execution.recovery import Recovery, RecoveryState
from genpolicy.tasks.api import Task, World

Array = NDArray[np.float64]


class PlannedFallback:
    """Trajectory of the primitive in force, and how much of it has been commanded."""

    def __init__(self) -> None:
        self._chunks = 0
        self._planned: tuple[tuple[str, int, int], Array, int] | None = None

    def next_chunk(self) -> int:
        """Number of the next chunk of this rollout, from 1."""
        self._chunks += 1
        return self._chunks

    def rest(
        self, task: Task, world: World, recovery: Recovery, state: RecoveryState, *, ticks: int
    ) -> Array:
        """What is left of the primitive; another attempt or state plans anew.

        Args:
            task: Plans the primitive.
            world: From where it begins.
            recovery: Counts the attempts.
            state: Names the primitive.
            ticks: Fallback actions commanded so far in this rollout.

        Returns:
            Actions, none when it is done. Shape (n, 10).
        """
        key = (str(state), recovery.attempts, recovery.failures)
        if self._planned is None or self._planned[0] != key:
            self._planned = (key, task.fallback(world, str(state)), ticks)
        _, actions, begun = self._planned
        return actions[ticks - begun :]
