"""Ways that take turns, and what each of them took.

A turn runs each part of a way once to warm the caches behind whoever came before, then some updates
by both clocks. Processor time says what a way costs where others use the machine too; with more
than one thread it counts the waiting of one for the other as well.
"""

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from genpolicy.policies.determinism import deterministic
from genpolicy.statistics.intervals import order_statistic_interval

Array = NDArray[np.float64]


class Spent(NamedTuple):
    """What a turn took, ms an update."""

    processor: float
    wall: float


class Way(Protocol):
    """Something that can be run for some updates at a time."""

    def turn(self, updates: int) -> Spent:
        """Run, and say what an update took."""


@dataclass(frozen=True)
class InTurn:
    """Parts of this process, one behind the other.

    Attributes:
        parts: Each runs one update of one or of several trainings.
        threads: Of torch.
        fixed: Whether they run in the regime in which the stages train.
    """

    parts: Sequence[Callable[[], object]]
    threads: int = 1
    fixed: bool = True

    def turn(self, updates: int) -> Spent:
        """Sum over the parts."""
        processor, wall = 0.0, 0.0
        with with_threads(self.threads, fixed=self.fixed):
            for part in self.parts:
                part()
                began, own = time.perf_counter(), time.process_time()
                for _ in range(updates):
                    part()
                processor += time.process_time() - own
                wall += time.perf_counter() - began
        return Spent(1e3 * processor / updates, 1e3 * wall / updates)


@contextlib.contextmanager
def with_threads(threads: int, *, fixed: bool) -> Iterator[None]:
    """So many threads inside the block; deterministic kernels where `fixed`, as stages have."""
    before = torch.get_num_threads()
    try:
        with deterministic("cpu") if fixed else contextlib.nullcontext():
            torch.set_num_threads(threads)
            yield
    finally:
        torch.set_num_threads(before)


def take_turns(
    ways: Mapping[str, Way], *, rounds: int, updates: int
) -> dict[str, dict[str, Array]]:
    """Times of each way by clock, one of each round, ms an update; the first round is dropped."""
    found: dict[str, list[Spent]] = {name: [] for name in ways}
    for _ in range(1 + rounds):
        for name, way in ways.items():
            found[name].append(way.turn(updates))
    return {
        name: dict(zip(Spent._fields, np.array(own[1:]).T, strict=True))
        for name, own in found.items()
    }


@dataclass(frozen=True)
class Median:
    """A median and its interval, of 95 % where the rounds are enough for one."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


def median(values: Array) -> Median:
    """Median of rounds, between order statistics."""
    return Median(float(np.median(values)), *order_statistic_interval(values, 0.5))
