"""Several numbers a row that hold for a while: one category an episode, or number by number.

An embedding of an instruction, a goal as one of several, a place that was drawn. As a whole such a
row is a category, where few different ones were recorded; else each of its numbers is a measure.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.leaves import cut
from genpolicy.data.variables import Runs

# More different rows than this are also asked number by number, as more numbers are a measure.
MOST_ROWS = 12
# A wider row is no place: its numbers mean nothing one by one.
MOST_NUMBERS = 16
# A category of more values than this tells nothing, and its texts fill the memory.
MOST_DIFFERENT = 10_000
KEY_BYTES = 16
NUMBER = "{:.6g}"

Kept = dict[str, dict[str, Runs]]
Array = NDArray[np.float64]
Integers = NDArray[np.int64]


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


@dataclass
class _Column:
    """What was recorded of one column: which of its different rows, and narrow rows themselves."""

    rows: dict[str, Integers] = field(default_factory=dict)
    codes: dict[str, Integers] = field(default_factory=dict)
    numbers: dict[str, Array] = field(default_factory=dict)
    known: dict[bytes, int] = field(default_factory=dict)
    texts: list[str] = field(default_factory=list)
    widths: set[int] = field(default_factory=set)
    full: bool = False

    def add(self, uuid: str, rows: Integers, values: Array) -> None:
        self.rows[uuid] = rows
        self.widths.add(values.shape[1])
        # Wide ones are not kept number by number: there may be one in every few rows.
        if values.shape[1] <= MOST_NUMBERS:
            self.numbers[uuid] = values
        self.codes[uuid] = np.array([self._code(row) for row in values], dtype=np.int64)
        if self.full:
            self.codes, self.known, self.texts = {}, {}, []

    @property
    def is_narrow(self) -> bool:
        """Whether all rows are of one width, and narrow."""
        return len(self.widths) == 1 and max(self.widths) <= MOST_NUMBERS

    def _code(self, row: Array) -> int:
        key = blake2b(row.tobytes(), digest_size=KEY_BYTES).digest()
        if self.full or (key not in self.known and len(self.known) == MOST_DIFFERENT):
            self.full = True
            return -1
        if key not in self.known:
            self.known[key] = len(self.texts)
            self.texts.append(_written(row))
        return self.known[key]


class Vectors:
    """Gathers, episode by episode, what was recorded in several numbers a row."""

    def __init__(self) -> None:
        """Nothing yet."""
        self._columns: dict[str, _Column] = {}

    def add(self, name: str, uuid: str, rows: NDArray[Any], values: NDArray[Any]) -> None:
        """Remember the runs of one episode.

        Args:
            name: What the column is called.
            uuid: The episode.
            rows: Where each run begins. Shape (runs,).
            values: Its numbers, all NaN where nothing was recorded. Shape (runs, width).
        """
        # Zero has one sign here.
        numbers = np.ascontiguousarray(values, dtype=np.float64) + 0.0
        column = self._columns.setdefault(name, _Column())
        column.add(uuid, np.asarray(rows, dtype=np.int64), numbers)

    def recorded(self) -> Kept:
        """Each as a category, and number by number where many different rows were recorded."""
        found: Kept = {}
        for name, column in self._columns.items():
            if not column.full:
                found[name] = {
                    uuid: Runs(tuple(rows.tolist()), tuple(column.texts[k] for k in codes.tolist()))
                    for (uuid, codes), rows in zip(
                        column.codes.items(), column.rows.values(), strict=True
                    )
                }
            many = column.full or len({*column.texts}) > MOST_ROWS
            if many and column.is_narrow:
                found |= dict(_one_by_one(name, column))
        return found

    def overfull(self) -> list[str]:
        """Columns of which nothing is kept: too many different rows, and too wide for measures."""
        return sorted(n for n, c in self._columns.items() if c.full and not c.is_narrow)


def _one_by_one(name: str, column: _Column) -> Iterator[tuple[str, dict[str, Runs]]]:
    for k in range(max(column.widths)):
        yield (
            f"{name}[{k}]",
            {
                uuid: Runs(tuple(column.rows[uuid].tolist()), tuple(values[:, k].tolist()))
                for uuid, values in column.numbers.items()
            },
        )


def _written(value: Array) -> str:
    """The numbers as a text; "" where nothing was recorded."""
    if np.isnan(value).all():
        return ""
    return cut(", ".join(NUMBER.format(number) for number in value.tolist()))
