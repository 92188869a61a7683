"""What a base recording is asked for: its seed, and what decides the ways."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.audit_real.truth import Facts
from genpolicy.seeds import stream


@dataclass(frozen=True)
class Plan:
    """How a base is made.

    Attributes:
        seed: Of every draw.
        decided_by: Empty: a free choice; `start`: the side on which the episode begins; `order`: in
            turns of a few episodes, as a person who is told a side per session.
        failing: Share of the episodes of all ways but the first that fail.
        tremor: White noise on the commands, in units of the distance of the ways.
        episodes: How many; None takes the base's own number.
    """

    seed: int
    decided_by: str = ""
    failing: float = 0.0
    tremor: float = 0.0
    episodes: int | None = None

    def drawn(self, *names: str | int) -> np.random.Generator:
        """The stream of these names."""
        return stream(self.seed, "audit_real", *names)

    def ways(self, episodes: int, count: int) -> NDArray[np.int64]:
        """Way of each episode, evenly but for chance. Shape (E,)."""
        rng = self.drawn("ways")
        if self.decided_by == "order":
            lengths = rng.integers(6, 11, episodes)
            return np.searchsorted(np.cumsum(lengths), np.arange(episodes), side="right") % count
        even = np.arange(episodes) % count
        return rng.permutation(even)

    def outcomes(self, ways: NDArray[np.int64], *, honest: float = 0.03) -> NDArray[np.bool_]:
        """Which episodes succeed. Shape (E,)."""
        rng = self.drawn("outcomes")
        fails = rng.random(len(ways)) < honest
        return ~(fails | ((ways > 0) & (rng.random(len(ways)) < self.failing)))

    def facts(self, modes: int, **more: object) -> Facts:
        """What is true of a base with so many ways."""
        return Facts(
            modes=modes,
            decided_by=self.decided_by if modes > 1 else "",
            failing=self.failing > 0.0 and modes > 1,
            tremor=self.tremor > 0.0,
            **more,  # type: ignore[arg-type]
        )
