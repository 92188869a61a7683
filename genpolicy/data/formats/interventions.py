"""Rows in which a person corrected a policy, as recorders of both flag them row by row.

What a policy did and what a person did instead are two answers to one observation, and who acted
is not seen in it: the flag is a reason like any other column. How much of an episode was corrected
is none: it counts what came behind the choice.
"""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.source import RawEpisode, as_float

TRUE, FALSE = ("true", "1", "1.0", "yes"), ("false", "0", "0.0", "no")
"""Words of recorders for yes and no, in small letters; of rows and of an episode alike."""


class Interventions:
    """Counts what a column of flags says, episode by episode."""

    def __init__(self, column: str | None) -> None:
        """Nothing yet.

        Args:
            column: The column; None where the recordings have none.
        """
        self._column = column
        self._rows = self._corrected = self._episodes = self._with = 0
        self._by_row = False

    def add(self, raw: RawEpisode) -> None:
        """Count an episode."""
        flags = flags_of(raw.columns[self._column]) if self._column in raw.columns else None
        if flags is None or self._column is None or not np.isfinite(flags).any():
            return
        known = flags[np.isfinite(flags)]
        self._episodes += 1
        self._rows += len(known)
        self._corrected += int(known.sum())
        self._with += bool(known.any())
        self._by_row |= bool(known.min() != known.max())

    def notes(self, asked: Collection[str]) -> list[str]:
        """What the flags say, where they change inside episodes.

        Args:
            asked: The columns that are asked as reasons.
        """
        if not self._by_row:
            return []
        return [
            f"{self._column} says where a person corrected: {self._corrected / self._rows:.0%} of "
            f"the rows, in {self._with} of {self._episodes} episodes."
            + (" It is asked as a reason." if self._column in asked else "")
        ]


def flags_in(raw: RawEpisode, column: str | None) -> NDArray[np.float64] | None:
    """The flags of an episode, by row or one for all of it; None where it has none."""
    if column in raw.columns:
        return flags_of(raw.columns[column])
    said = raw.attributes.get(column) if column is not None else None
    return None if said is None else flags_of(np.array([said], dtype=object))


def flags_of(values: NDArray[np.generic]) -> NDArray[np.float64] | None:
    """0 or 1 by row, NaN where not recorded; None where a value is neither. Shape (n,)."""
    if values.ndim != 1:
        return None
    if values.dtype.kind in "fiub":
        numbers = as_float(values)
        plain = np.isnan(numbers) | (numbers == 0.0) | (numbers == 1.0)
        return numbers if bool(plain.all()) else None
    texts = [str(value).strip().lower() for value in values.tolist()]
    if not all(text in (*TRUE, *FALSE, "") for text in texts):
        return None
    return np.array([np.nan if text == "" else float(text in TRUE) for text in texts])
