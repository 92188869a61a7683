"""A task's classical planner, where it offers one: the simplest method that Gate D compares.

A task that offers one has a member `planner` beside those of `genpolicy.tasks.api.Task`. It sees
what every policy sees, observations as they arrived, and nothing else: neither the world nor how
an operator chose. A task without one lacks the member, or has None there.
"""

from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.tasks.api import Task

Array = NDArray[np.float64]


class Planner(Protocol):
    """Plans a chunk from observations; equal observations give equal chunks, to the bit."""

    def __call__(self, history: Array, *, horizons: HorizonConfig) -> Array:
        """A chunk in physical units, whose first row begins where the newest observation was made.

        It remembers nothing between two calls: what it is asked before changes no answer.

        Args:
            history: The last observations, oldest first. Shape (H_o, D_o).
            horizons: Of the ladder; the period of the rows among them.

        Returns:
            Shape (K, D_a), K = `horizons.prediction_horizon`.
        """
        ...


class _Offering(Protocol):
    """A task that offers one."""

    planner: Planner | None


def planner_of(task: Task) -> Planner | None:
    """The planner that a task offers; None where it offers none."""
    return cast(_Offering, task).planner if hasattr(task, "planner") else None
