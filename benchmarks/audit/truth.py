"""What happened in one episode, before any sensor looked at it; the same shape for every task."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]

SUB_STEPS = 5
# Time constant of a plant without inertia.
INSTANT_S = 1e-9


@dataclass(frozen=True)
class Truth:
    """One episode; T action ticks, F fine times.

    Attributes:
        command: Commanded position at each tick. Shape (T, P).
        fine_s: Fine times since the first tick, also before and after it. Shape (F,).
        fine: True position at the fine times. Shape (F, P).
        scene: What the camera sees at the begin of the episode: the goal first. Shape (S,).
        lamp: A light that stands for the intended mode: -1, 0 (off) or 1. Shape (T,).
        phase: Task phase at each tick. Length T.
        success: Whether the task was done.
        moved: How far the goal has moved since, at each tick; None: it stands. Shape (T, 2).
        other: Further components at each tick, `observed` and `commanded`. Shapes (T, .).
    """

    command: Array
    fine_s: Array
    fine: Array
    scene: Array
    lamp: Array
    phase: list[str]
    success: bool
    other: dict[str, Array]
    moved: Array | None = None

    def position(self, time_s: Array) -> Array:
        """True position at the given times. Shape (n, P)."""
        columns = [np.interp(time_s, self.fine_s, column) for column in self.fine.T]
        return np.stack(columns, axis=1)


def follow(command: Array, *, period_s: float, delay_s: float, constant_s: float) -> Array:
    """Position of a first-order plant behind the command, at `SUB_STEPS` times per tick.

    Args:
        command: Commanded positions; the first is where the arm rests before. Shape (T, P).
        period_s: Time between commands.
        delay_s: Dead time.
        constant_s: Time constant.

    Returns:
        Shape (T * SUB_STEPS, P); the first row at the first tick.
    """
    ticks = period_s * np.arange(len(command))
    times = period_s / SUB_STEPS * np.arange(len(command) * SUB_STEPS)
    rest = command[0]
    target = np.stack([np.interp(times - delay_s, ticks, c) for c in (command - rest).T], axis=1)
    share = 1.0 - np.exp(-period_s / SUB_STEPS / constant_s)
    return rest + lfilter([share], [1.0, share - 1.0], target, axis=0)
