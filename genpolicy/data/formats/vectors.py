"""Several numbers a row that hold for a while: one category an episode, or number by number.

An embedding of an instruction, a goal as one of several, a place that was drawn. As a whole such a
row is a category, where few different ones were recorded; else each of its numbers is a measure.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.leaves import Vector, cut
from genpolicy.data.variables import Runs

# More different rows than this are also asked number by number, as more numbers are a measure.
MOST_ROWS = 12
# A wider row is no place: its numbers mean nothing one by one.
MOST_NUMBERS = 16
NUMBER = "{:.6g}"

Kept = dict[str, dict[str, Runs]]


def starts_of(values: NDArray[Any]) -> NDArray[np.int64]:
    """Where each run of equal rows begins; NaN equals NaN.

    Args:
        values: Numbers by row. Shape (n, width), n >= 1.
    """
    same = values[1:] == values[:-1]
    if values.dtype.kind == "f":
        missing = np.isnan(values)
        same |= missing[1:] & missing[:-1]
    return np.concatenate([[0], np.flatnonzero(~same.all(axis=1)) + 1]).astype(np.int64)


class Vectors:
    """Gathers, episode by episode, what was recorded in several numbers a row."""

    def __init__(self) -> None:
        """Nothing yet."""
        self._whole: Kept = {}
        self._numbers: dict[str, dict[str, tuple[tuple[int, ...], tuple[Vector, ...]]]] = {}

    def add(self, name: str, uuid: str, rows: Sequence[int], values: Sequence[Vector]) -> None:
        """Remember the runs of one episode.

        Args:
            name: What the column is called.
            uuid: The episode.
            rows: Where each run begins.
            values: Its numbers, all NaN where nothing was recorded.
        """
        texts = tuple(_written(value) for value in values)
        self._whole.setdefault(name, {})[uuid] = Runs(tuple(rows), texts)
        # Wide ones are not kept number by number: there may be one in every few rows.
        if all(len(value) <= MOST_NUMBERS for value in values):
            self._numbers.setdefault(name, {})[uuid] = tuple(rows), tuple(values)

    def recorded(self) -> Kept:
        """Each as a category, and number by number where many different rows were recorded."""
        found: Kept = dict(self._whole)
        for name, by_episode in self._numbers.items():
            widths = {len(value) for _, values in by_episode.values() for value in values}
            different = {text for runs in self._whole[name].values() for text in runs.values}
            if len(different) > MOST_ROWS and len(widths) == 1:
                found |= dict(_one_by_one(name, by_episode, max(widths)))
        return found


def _one_by_one(
    name: str, by_episode: dict[str, tuple[tuple[int, ...], tuple[Vector, ...]]], width: int
) -> Iterator[tuple[str, dict[str, Runs]]]:
    for k in range(width):
        yield (
            f"{name}[{k}]",
            {
                uuid: Runs(rows, tuple(float(value[k]) for value in values))
                for uuid, (rows, values) in by_episode.items()
            },
        )


def _written(value: Vector) -> str:
    """The numbers as a text; "" where nothing was recorded."""
    if all(np.isnan(value)):
        return ""
    # Zero has one sign here.
    return cut(", ".join(NUMBER.format(number + 0.0) for number in value))
