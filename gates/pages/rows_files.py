"""One CSV file of rows: all of them, a sample that fits, or what is counted in them.

A cell has nine digits of a number, the first ones of a hash, and no text that a program runs.
"""

import csv
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from types import SimpleNamespace
from typing import Any

import pyarrow as pa

from gates.words import HASH, SHOWN_HASH
from genpolicy.integrity.hashing import sha256_bytes

SIGNED_CARD = ".dsse.json"
LARGEST_BYTES = 100_000
"""Of one file: 300 rollouts with all their columns are half of it, and git keeps every version."""
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""How a text begins that a spreadsheet would run."""
EQUAL_ROWS = "rows"
"""Column of a folded file: how many rows of the table its line stands for."""


@dataclass(frozen=True)
class RowsFile:
    """Rows of one table or document, or of one method in it.

    Attributes:
        path: Of the evidence.
        method: Whose rows they are; empty where the table does not tell methods apart.
        name: Of the file in its folder.
        kept: Rows that it holds.
        of: Rows that there are.
        data: Its bytes.
        folded: Whether each line stands for all rows that are equal in its columns.
    """

    path: str
    method: str
    name: str
    kept: int
    of: int
    data: bytes = field(repr=False)
    folded: bool = False

    @property
    def said(self) -> str:
        """How many rows it holds, and of how many where it holds not all."""
        if self.folded:
            return f"{self.of:,} rows, equal ones in one line"
        if self.kept == self.of:
            return f"{self.of:,} row{'' if self.of == 1 else 's'}"
        return f"a sample of {self.kept:,} of {self.of:,} rows"

    @property
    def title(self) -> str:
        """Its evidence without folder and ending, for a link."""
        if self.path.endswith(SIGNED_CARD):
            return PurePosixPath(self.name).stem
        stem = PurePosixPath(self.path).stem.replace("_", " ")
        stem = f"counts of {stem}" if self.folded else stem
        return f"{stem} of {self.method}" if self.method else stem


def whole_or_counted(
    path: str, method: str, base: str, table: pa.Table, counted: Sequence[str]
) -> Iterator[RowsFile]:
    """The rows, and where they are a sample what is counted in all of them."""
    file = sampled(path, method, f"{base}.csv", table)
    yield file
    if counted and file.kept < file.of:
        folded = _folded(path, method, f"{base}.counts.csv", table.select(list(counted)))
        if len(folded.data) <= LARGEST_BYTES:  # a sample of lines that stand for many says nothing
            yield folded


def _folded(path: str, method: str, name: str, table: pa.Table) -> RowsFile:
    """Each row that there is once, with how many there are of it, in the order of their cells."""
    cells = [[_cell(value) for value in column.to_pylist()] for column in table.columns]
    many = Counter(zip(*cells, strict=True))
    lines = [(*row, count) for row, count in sorted(many.items())]
    data = b"".join(lines_of([*table.column_names, EQUAL_ROWS], *lines))
    return RowsFile(path, method, name, table.num_rows, table.num_rows, data, folded=True)


def sampled(path: str, method: str, name: str, table: pa.Table) -> RowsFile:
    """All rows with their numbers in the table, or as many as the bound allows.

    Which ones is drawn by their numbers, so that no condition or candidate is favoured by the
    order of the table, and the same rows are drawn again.
    """
    numbers: list[int] = list(range(table.num_rows))
    most = LARGEST_BYTES // (2 * table.num_columns)  # a cell and its comma are two bytes or more
    if len(numbers) > most:
        numbers = sorted(numbers, key=_drawn)[:most]
    taken = table.take(pa.array(numbers, pa.int64()))
    cells = [[_cell(value) for value in column.to_pylist()] for column in taken.columns]
    counted = [number + 1 for number in numbers]
    head, *lines = lines_of(["row", *table.column_names], *zip(counted, *cells, strict=True))
    kept = dict(zip(numbers, lines, strict=True))
    if sum(map(len, lines)) > LARGEST_BYTES - len(head):
        kept = _within(kept, LARGEST_BYTES - len(head))
    data = head + b"".join(kept[number] for number in sorted(kept))
    return RowsFile(path, method, name, len(kept), table.num_rows, data)


def _drawn(number: int) -> bytes:
    """Place of a row in the draw."""
    return sha256_bytes(str(number).encode()).encode()


def _within(lines: Mapping[int, bytes], most: int) -> dict[int, bytes]:
    """As many lines as fit, in the order in which they are drawn."""
    found: dict[int, bytes] = {}
    for number in sorted(lines, key=_drawn):
        most -= len(lines[number])
        if most < 0:
            break
        found[number] = lines[number]
    return found


def _cell(value: Any) -> str:
    """A cell: nine digits of a number, the first ones of a hash, a text that no program runs."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.9g}"
    text = str(value)
    if HASH.fullmatch(text):
        return text[:SHOWN_HASH]
    return f"'{text}" if isinstance(value, str) and text.startswith(FORMULA) else text


def lines_of(*rows: Sequence[Any]) -> list[bytes]:
    """Each row as its line of a CSV file."""
    texts: list[str] = []
    csv.writer(SimpleNamespace(write=texts.append), lineterminator="\n").writerows(rows)
    return [text.encode() for text in texts]
