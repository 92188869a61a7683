"""The fallback in a rollout: its primitive is planned once, from where it begins."""

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import ChunkMetadata
from genpolicy.evidence.stress.state import Setup
from genpolicy.execution.cell import RecoveryState
from genpolicy.execution.executor import Executor
from genpolicy.execution.recovery import Primitive, Recovery, fallback_metadata
from genpolicy.tasks.api import World

Array = NDArray[np.float64]


class Fallback:
    """Trajectory of the primitive in force, and how much of it has been commanded.

    Args:
        setup: What all rollouts share.
        world: From where a primitive begins.
        executor: Holds the epochs.
        recovery: Counts the attempts.
    """

    def __init__(self, setup: Setup, world: World, executor: Executor, recovery: Recovery) -> None:
        self._setup = setup
        self._world = world
        self._executor = executor
        self._recovery = recovery
        self._chunks = 0
        self._planned: tuple[tuple[str, int, int], Array, int] | None = None

    def metadata(self, session: str, now_s: float) -> ChunkMetadata:
        """Metadata of the next chunk of the fallback in a session, counted from 1."""
        self._chunks += 1
        return fallback_metadata(
            self._executor,
            now_s=now_s,
            chunk_id=f"{session}/fallback/{self._chunks}",
            event_time_s=now_s,
            phase=self._world.phase,
            epoch=self._world.calibration_epoch,
        )

    def plan(self, state: RecoveryState, *, ticks: int) -> Primitive:
        """What is left of the primitive; another attempt or state plans anew.

        Args:
            state: Names the primitive.
            ticks: Fallback actions commanded so far in this rollout.
        """
        key = (str(state), self._recovery.attempts, self._recovery.failures)
        if self._planned is None or self._planned[0] != key:
            planned = self._setup.task.fallback(self._world, str(state))
            self._planned = (key, planned, ticks)
        _, actions, begun = self._planned
        rest = actions[ticks - begun :]
        return Primitive(rest[: self._setup.horizons.prediction_horizon], reached=len(rest) == 0)
