"""A scripted person: called by recovery, takes over after a time, drives, and hands back.

It drives by the task's classical plan, as the fallback does: each chunk is judged by the six
layers, queued, checked again at the stub and stopped by the supervisor. It resets nothing. What
comes of an episode after it is not the policy's.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import ChunkMetadata, Proposal
from genpolicy.evidence.stress.settings import PersonSettings
from genpolicy.execution.attended import AttendedExecutor
from genpolicy.execution.cell import RecoveryState
from genpolicy.execution.journal import Event
from genpolicy.execution.nanoseconds import NS_PER_S
from genpolicy.execution.recovery import Admit, Recovery
from genpolicy.seeds import stream
from genpolicy.tasks.api import Task, World

Array = NDArray[np.float64]

WHO = "scripted person"
"""Its name, by which its chunks and its events are known; no name of anybody."""
PLAN = RecoveryState.CLASSICAL_RETURN
"""What it drives: the task's way back to where the policy can begin."""


class Attendance:
    """The person of one rollout, or that there is none.

    Args:
        settings: How fast and how long; None: nobody comes, and a call ends the rollout.
        task: Plans.
        world: Where from.
        executor: By whom its chunks are executed.
        recovery: Who calls.
        key: Names of its draws: root seed, condition, start.

    Attributes:
        calls: Calls for a person so far.
    """

    def __init__(  # noqa: PLR0917
        self,
        settings: PersonSettings | None,
        task: Task,
        world: World,
        executor: AttendedExecutor,
        recovery: Recovery,
        key: tuple[int, str, int],
    ) -> None:
        self.calls = 0
        self._settings = settings
        self._task, self._world = task, world
        self._executor, self._recovery = executor, recovery
        self._key = key
        self._ready_s: float | None = None
        self._since_s = self._spent_s = 0.0
        self._planned: tuple[Array, int] | None = None

    def attend(
        self,
        now_s: float,
        ticks: int,
        metadata: Callable[[], ChunkMetadata],
        admit: Admit,
    ) -> bool:
        """One tick of a call: come, drive, hand back.

        Args:
            now_s: Time, s.
            ticks: Actions of the classical plan commanded so far in this rollout.
            metadata: Makes the metadata of the next chunk of the fallback.
            admit: Feasibility; None when it rejects.

        Returns:
            Whether the rollout goes on.
        """
        if self._ready_s is None:
            self._ready_s = now_s + self._called()
            self._executor.intervene(now_s)
        settings, state = self._settings, self._recovery.state
        if settings is None or state is RecoveryState.ABORT:
            return False
        if state is RecoveryState.ASK_HUMAN:
            come = now_s >= self._ready_s - 1e-9 and self._executor.take_over(now_s, WHO)
            if not come:
                return True
            self._recovery.person_takes_over(now_s, WHO)
            self._since_s, self._planned = now_s, None
        if self._spent_s + (now_s - self._since_s) > settings.longest_s:
            self._executor.intervene(now_s)
            self._recovery.person_gave_up(now_s, WHO)
            return False
        if self._executor.needs_invocation(now_s):
            self._drive(now_s, ticks, metadata, admit)
        return True

    def _called(self) -> float:
        """How long until the person has the arm, s."""
        root_seed, condition, start = self._key
        draw = stream(root_seed, "person", condition, start, self.calls)
        self.calls += 1
        least, most = self._settings.reaction_s if self._settings else (0.0, 0.0)
        return float(draw.uniform(least, most))

    def _drive(
        self,
        now_s: float,
        ticks: int,
        metadata: Callable[[], ChunkMetadata],
        admit: Admit,
    ) -> None:
        """The next part of the plan; at its end, and with the arm there, back to the policy."""
        if self._planned is None:
            self._planned = (self._task.fallback(self._world, PLAN), ticks)
        actions, begun = self._planned
        rest = actions[ticks - begun :]
        if len(rest) == 0:
            away_m = np.linalg.norm(self._world.tcp_pose[0] - self._world.last_action[:3])
            if self._executor.cell.execution.maximum_divergence_m - float(away_m) >= 0:
                self._spent_s += now_s - self._since_s
                self._ready_s = None
                self._executor.hand_back(now_s)
                self._recovery.person_handed_back(now_s, WHO)
            return
        told = replace(metadata(), method=WHO)
        rows = self._executor.cell.horizons.prediction_horizon
        admitted = admit(Proposal(told, rest[:rows], selected_by=WHO))
        if admitted is None or self._executor.deliver_fallback(admitted, now_s) is not None:
            self._planned = None  # it looks again from where the arm is


def person_s(events: Iterable[Event]) -> float:
    """How long a person had the arm in a session, s, up to its last event."""
    had_ns, since_ns, last_ns = 0, None, 0
    for event in events:
        last_ns = event.t
        if event.kind == "person":
            if event.payload["stage"] == "took_over":
                since_ns = event.t
            elif since_ns is not None:
                had_ns, since_ns = had_ns + event.t - since_ns, None
    if since_ns is not None:
        had_ns += last_ns - since_ns
    return had_ns / NS_PER_S
