"""One recorded column that may be why demonstrations differ, as values by episode or by row."""

from dataclasses import dataclass, replace
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

# Said of what has another value in one episode.
INSIDE = "switches inside episodes"
# What is known by name of every episode, where it is recorded.
EPISODE_VARIABLES = ("operator", "object", "calibration_epoch")
Integers = NDArray[np.int64]
Values = NDArray[np.int64] | NDArray[np.float64]


@dataclass(frozen=True)
class Variable:
    """A recorded column.

    Groups are numbered in the order of their first episode, so that their names change nothing;
    measures are numbers, NaN where not recorded.

    Attributes:
        name: What the verdict calls it.
        values: Groups (integers) or measures. Shape (E,), or (N,) where it switches inside
            episodes.
        by_row: Whether there is one value a row.
        also: Other columns that say the same.
    """

    name: str
    values: Values
    by_row: bool = False
    also: tuple[str, ...] = ()

    @property
    def is_measure(self) -> bool:
        """Numbers with an order, instead of groups."""
        return self.values.dtype.kind == "f"

    @property
    def key(self) -> str:
        """Names its draws by what it says, whatever it is called."""
        kind = f"{self.values.dtype.kind}{self.by_row}".encode()
        return sha256(kind + np.ascontiguousarray(self.values).tobytes()).hexdigest()[:16]

    def at(self, rows: Integers, episode: Integers) -> Values:
        """Values of rows.

        Args:
            rows: Rows. Shape (n,).
            episode: Episode of each of them. Shape (n,).
        """
        return self.values[rows if self.by_row else episode]

    def reordered(self, rows: Integers, episodes: Integers) -> "Variable":
        """The same variable of rows and episodes in another order."""
        values = self.values[rows if self.by_row else episodes]
        return replace(self, values=values if self.is_measure else numbered(values))


def numbered(values: NDArray[np.generic]) -> Integers:
    """Groups numbered in the order in which they first appear. Shape (n,)."""
    _, first, place = np.unique(values, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return np.asarray(rank[place.reshape(-1)], dtype=np.int64)
