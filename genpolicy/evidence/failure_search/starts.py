"""Starts by choice instead of by lot: the task makes them from numbers that are given to it.

A task draws a start from a generator and knows its own ranges. Given a stand-in that hands out
chosen numbers in the place of drawn ones, it makes exactly the starts that it could have drawn,
and nobody outside of it has to know a range.
"""

import math
from typing import Any, NoReturn, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from genpolicy.errors import ConfigError
from genpolicy.tasks.api import Start, Task

Array = NDArray[np.float64]

MOST_COORDINATES = 64
"""A task that draws more numbers for a start is none whose starts can be searched so."""


class Chosen:
    """Stands in for a generator of uniform numbers.

    Args:
        task: Name of the task, for messages.
        unit: The numbers, in [0, 1], in the order in which they are drawn. Shape (n,).

    Attributes:
        drawn: How many were drawn so far.
    """

    def __init__(self, task: str, unit: Array) -> None:
        self.drawn = 0
        self._task = task
        self._unit = np.asarray(unit, dtype=np.float64)

    def random(self, size: int | tuple[int, ...] | None = None, **other: object) -> Any:
        """The next numbers as they are."""
        if other:
            self.refuse(f"drawing a start with {', '.join(other)}")
        return self.uniform(size=size)

    def uniform(
        self,
        low: ArrayLike = 0.0,
        high: ArrayLike = 1.0,
        size: int | tuple[int, ...] | None = None,
    ) -> Any:
        """The next numbers, between `low` and `high`, which may be arrays, as numpy takes them."""
        least, most = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
        shape = np.broadcast_shapes(least.shape, most.shape)
        if size is not None:
            shape = np.broadcast_shapes(shape, size)
        count = math.prod(shape)
        following = self._unit[self.drawn : self.drawn + count]
        if len(following) < count:
            self.refuse(f"drawing more than {len(self._unit)} numbers for a start")
        self.drawn += count
        values = least + (most - least) * following.reshape(shape)
        return values if shape else float(values)

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("__"):
            raise AttributeError(name)
        self.refuse(f"drawing a start by `{name}`")

    def refuse(self, found: str) -> NoReturn:
        """Starts that cannot be chosen."""
        raise ConfigError(
            where=f"task {self._task}: sample_start",
            found=found,
            expected="uniform draws, as many for every start, for the failure search to choose",
            action="Draw by `uniform` or `random`, or set card.failure_search.evaluations to 0.",
        )


def coordinates_of(task: Task) -> int:
    """How many numbers a start of the task is drawn from.

    Raises:
        ConfigError: It draws otherwise than uniformly, or too many.
    """
    middle = Chosen(task.name, np.full(MOST_COORDINATES, 0.5))
    task.sample_start(cast(np.random.Generator, middle))
    if middle.drawn == 0:
        middle.refuse("a start of which no number is drawn")
    return middle.drawn


def chosen_start(task: Task, unit: Array) -> Start:
    """The start that the task would draw from these numbers.

    Args:
        task: Makes it.
        unit: In [0, 1]. Shape (n,).

    Raises:
        ConfigError: It draws otherwise than uniformly, or more numbers than these.
    """
    return task.sample_start(cast(np.random.Generator, Chosen(task.name, unit)))
