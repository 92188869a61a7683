"""A recording before it is written: rows as a robot's own recorder holds them, whatever the layout.

Beside what is written stands what is known of it: the absolute command behind each action, the way
that each row followed, and what is true of the whole. None of these is ever written.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.audit_real.truth import Facts

Array = NDArray[np.float64]
LAYOUTS = ("lerobot2", "lerobot3", "robomimic", "zarr", "parquet", "parquet_files")


@dataclass(frozen=True)
class Episode:
    """One episode of T rows.

    Attributes:
        seen: Observed columns by name. Each of shape (T, w).
        action: What is written as the action. Shape (T, A).
        command: Absolute command behind each action. Shape (T, A).
        mode: Way that each row follows; never written. Shape (T,).
        number: Which demonstration it is, whatever its place; never written.
        rows: Further recorded columns, which no policy sees. Each of shape (T,).
        facts: What the recorder says of the whole episode, by name.
        time_s: Clock of the rows, from the begin of the episode; None: no clock. Shape (T,).
        faulty: A defect was planted here; never written.
    """

    seen: dict[str, Array]
    action: Array
    command: Array
    mode: NDArray[np.int64]
    number: int
    rows: dict[str, NDArray[np.generic]] = field(default_factory=dict)
    facts: dict[str, str | int | bool] = field(default_factory=dict)
    time_s: Array | None = None
    faulty: bool = False

    def __len__(self) -> int:
        return len(self.action)

    def taken(self, rows: NDArray[np.int64]) -> "Episode":
        """Only these rows, in this order; the clock goes on as it began."""
        return replace(
            self,
            seen={name: values[rows] for name, values in self.seen.items()},
            action=self.action[rows], command=self.command[rows], mode=self.mode[rows],
            rows={name: values[rows] for name, values in self.rows.items()},
            time_s=None if self.time_s is None else self._clock(len(rows)),
        )  # fmt: skip

    def _clock(self, count: int) -> Array:
        assert self.time_s is not None
        period = float(np.median(np.diff(self.time_s)))
        return self.time_s[0] + period * np.arange(count)


@dataclass(frozen=True)
class Recording:
    """Episodes in the order in which they are stored.

    Attributes:
        name: Of the file or folder.
        layout: One of `LAYOUTS`.
        rate_hz: Rows per second.
        episodes: The episodes.
        names: Names of the numbers of each observed column; empty where they have none.
        action_names: The same of the action.
        follows: (column, number) that each action commands; None where nothing observed follows.
        form: How the action is written: absolute, delta, velocity, normalised.
        truth: What is true of it.
        scale: How far the ways lie apart, in units of the command; never written.
        real: Recorded by others: what is true of the whole is a specialist's judgement.
    """

    name: str
    layout: str
    rate_hz: float
    episodes: tuple[Episode, ...]
    names: dict[str, tuple[str, ...]]
    action_names: tuple[str, ...]
    follows: tuple[tuple[str, int] | None, ...]
    form: str
    truth: Facts
    scale: float = 1.0
    real: bool = False

    def each(self, change: Callable[[Episode], Episode]) -> "Recording":
        """The recording with every episode changed."""
        return replace(self, episodes=tuple(change(episode) for episode in self.episodes))

    def true(self, **facts: object) -> "Recording":
        """The recording with other facts."""
        return replace(self, truth=replace(self.truth, **facts))

    @property
    def paired(self) -> list[int]:
        """Actions that command an observed number."""
        return [k for k, place in enumerate(self.follows) if place is not None]

    @property
    def modes(self) -> NDArray[np.int64]:
        """Way of each episode at its end. Shape (E,)."""
        return np.array([int(episode.mode[-1]) for episode in self.episodes])
