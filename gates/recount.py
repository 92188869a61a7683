"""Which rows a number counts, so that a reader counts them again in a spreadsheet.

A criterion takes its rows by a `Subset` and its hits by terms; the report says the same terms in
words. So what is said is what was counted: there is no second account of it that could be wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from gates.evidence import counts, flags, numbers
from gates.report import Recount
from gates.words import share_of

Flags = NDArray[np.bool_]


class Term(Protocol):
    """A condition on the columns of a row."""

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that it reads."""

    def holds(self, frame: pd.DataFrame) -> Flags:
        """Where it holds. Shape (rows,)."""


@dataclass(frozen=True)
class Is:
    """A column holds one of some values; `true` and `false` are words of a table.

    Attributes:
        column: The column.
        values: Of which it holds one.
        other: Whether it must hold none of them instead.
    """

    column: str
    values: tuple[str | int | bool, ...]
    other: bool = False

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that it reads."""
        return (self.column,)

    def holds(self, frame: pd.DataFrame) -> Flags:
        """Where it holds; what is not known is neither true nor false.

        Raises:
            MissingEvidenceError: A column of true and false holds something else.
        """
        if any(isinstance(value, bool) for value in self.values):
            known = frame[self.column].notna().to_numpy()
            found = known & np.isin(flags(frame, self.column), self.values)
        else:
            found = np.asarray(frame[self.column].isin(self.values), dtype=np.bool_)
        return ~found if self.other else found

    def __str__(self) -> str:
        words = " or ".join(_word(value) for value in self.values)
        return f"{self.column} {'≠' if self.other else '='} {words}"


@dataclass(frozen=True)
class AtLeast:
    """A column holds a number of at least so much, or as much as another column.

    Attributes:
        column: The column.
        least: The number, or the name of the other column.
        times: By what the other column is multiplied.
    """

    column: str
    least: float | str
    times: float = 1.0

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that it reads."""
        return (self.column, self.least) if isinstance(self.least, str) else (self.column,)

    def holds(self, frame: pd.DataFrame) -> Flags:
        """Where it holds.

        Raises:
            MissingEvidenceError: A number is missing, or none.
        """
        least = self.least
        bound = self.times * numbers(frame, least) if isinstance(least, str) else least
        return np.asarray(numbers(frame, self.column) >= bound, dtype=np.bool_)

    def __str__(self) -> str:
        if not isinstance(self.least, str):
            return f"{self.column} >= {self.least:g}"
        factor = "" if self.times == 1.0 else f"{self.times:g} * "
        return f"{self.column} >= {factor}{self.least}"


@dataclass(frozen=True)
class Differs:
    """Two columns hold different texts."""

    column: str
    other: str

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that it reads."""
        return (self.column, self.other)

    def holds(self, frame: pd.DataFrame) -> Flags:
        """Where it holds."""
        return np.asarray(frame[self.column] != frame[self.other], dtype=np.bool_)

    def __str__(self) -> str:
        return f"{self.column} ≠ {self.other}"


@dataclass(frozen=True)
class NotAll:
    """Not all of some terms hold."""

    terms: tuple[Term, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that they read."""
        return tuple(name for term in self.terms for name in term.columns)

    def holds(self, frame: pd.DataFrame) -> Flags:
        """Where one of them does not."""
        return ~all_hold(self.terms, frame)

    def __str__(self) -> str:
        return f"not ({' and '.join(map(str, self.terms))})"


def is_one(column: str, *values: str | int | bool) -> Is:
    """A column holds one of some values."""
    return Is(column, values)


def is_none(column: str, *values: str | int | bool) -> Is:
    """A column holds none of some values."""
    return Is(column, values, other=True)


def all_hold(terms: Sequence[Term], frame: pd.DataFrame) -> Flags:
    """Where every term holds. Shape (rows,)."""
    held = (term.holds(frame) for term in terms)
    return reduce(np.logical_and, held, np.ones(len(frame), dtype=np.bool_))


@dataclass(frozen=True)
class Subset:
    """Rows of a table that a number counts.

    Attributes:
        table: Path of the table.
        terms: What holds of each of them, beside its method.
    """

    table: str
    terms: tuple[Term, ...] = ()

    def of(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Those rows of a frame.

        Raises:
            MissingEvidenceError: A column cannot be read as its term needs it.
        """
        return frame[all_hold(self.terms, frame)]

    def counted(self, frame: pd.DataFrame, *hits: Term) -> Recount:
        """What is counted again: rows, and those of them that are hits.

        Args:
            frame: The rows, as `of` gave them.
            hits: What holds of a hit; none where rows alone are counted.
        """
        columns = dict.fromkeys(name for term in (*self.terms, *hits) for name in term.columns)
        found = self._of_rows(frame, tuple(columns), float(len(frame)))
        if not hits:
            return found
        part = float(np.sum(all_hold(hits, frame)))
        return found.model_copy(update={"hits": tuple(map(str, hits)), "part": part})

    def summed(self, frame: pd.DataFrame, parts: tuple[str, ...], whole: str) -> Recount:
        """What is added up again: columns of these rows, and the column that they are parts of.

        Args:
            frame: The rows, as `of` gave them.
            parts: Columns whose sum is the part.
            whole: Column whose sum is the whole.

        Raises:
            MissingEvidenceError: A column holds no counts.
        """
        columns = dict.fromkeys(name for term in self.terms for name in term.columns)
        total = float(counts(frame, whole).sum())
        found = self._of_rows(frame, (*columns, *parts, whole), total)
        part = float(sum(counts(frame, name).sum() for name in parts))
        return found.model_copy(update={"of": whole, "summed": parts, "part": part})

    def _of_rows(self, frame: pd.DataFrame, columns: tuple[str, ...], whole: float) -> Recount:
        methods = set(frame["method"]) if "method" in frame else set()
        return Recount(
            table=self.table,
            method=str(methods.pop()) if len(methods) == 1 else "",
            where=tuple(map(str, self.terms)),
            columns=columns,
            of="",
            whole=whole,
            hits=(),
            summed=(),
            part=None,
        )


def part_share(recount: Recount) -> float:
    """The part of the whole, where more than rows is counted."""
    return _part(recount) / recount.whole


def part_said(recount: Recount, units: str) -> str:
    """The same with its counts: `96 % (48 of 50 rollouts)`."""
    return share_of(_part(recount), recount.whole, units)


def _part(recount: Recount) -> float:
    assert recount.part is not None, "of rows alone there is no share"
    return recount.part


def _word(value: str | int | bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value) or "(empty)"
