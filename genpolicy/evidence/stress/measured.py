"""What a cell measures of itself at every tick of a rollout, on record.

A failure is examined by what the arm did, and not by what it was told to do. So the joints, where
the TCP is, how far the gripper is open and the largest contact force of the period before stand in
the journal once a tick, from the first to the moment at which the rollout ends.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER
from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.execution.journal import Journal
from genpolicy.tasks.api import Task, World

Array = NDArray[np.float64]

DECIMALS = 6
"""Of rad, m and N: as fine as a float32, and read by viewers as it stands."""


class Measured:
    """The measured state of one rollout.

    Args:
        task: Says of an observation how far the gripper is open.
        world: What is measured.
        journal: Of the rollout.
    """

    def __init__(self, task: Task, world: World, journal: Journal) -> None:
        self._task, self._world, self._journal = task, world, journal
        self._told_s = -1.0
        self._joints: deque[Array] = deque(maxlen=2)

    @property
    def q_rad(self) -> Array:
        """Joint positions at the last tick, rad. Shape (J,)."""
        return self._joints[-1]

    @property
    def q_before_rad(self) -> Array | None:
        """The same a tick earlier; None at the first."""
        return self._joints[0] if len(self._joints) > 1 else None

    def note(self, now_s: float, observation: Array | None = None) -> None:
        """Put the state on record, once a time.

        Args:
            now_s: Time, s.
            observation: What is observed now; None: it is asked for. Shape (D_o,).
        """
        if now_s == self._told_s:
            return
        self._told_s, world = now_s, self._world
        self._joints.append(world.q_meas)
        seen = world.observe() if observation is None else observation
        position_m, rotation = world.tcp_pose
        opening_m = float(self._task.action_at(seen)[GRIPPER])
        payload = {
            "q_rad": rounded(world.q_meas),
            "tcp_m": rounded(position_m),
            "tcp_rotation": rounded(rotation_to_6d(rotation)),
            "gripper_m": round(opening_m, DECIMALS),
            "force_n": round(float(world.contact_force_n), DECIMALS),
        }
        self._journal.add("state", self._journal.clock(now_s), payload)


def rounded(values: Array) -> list[float]:
    """Numbers of `DECIMALS`; zero has no sign."""
    numbers: list[float] = (np.round(np.ravel(values), DECIMALS) + 0.0).tolist()
    return numbers
