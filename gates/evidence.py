"""Reading evidence: the bytes that are hashed are the bytes that are judged.

A judge sees the repository only through an `Evidence`. What it read, or bound without reading,
becomes the `materials` of its report, and what one criterion read becomes its `evidence`.
"""

import contextlib
import dataclasses
import typing
from collections.abc import Callable, Hashable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from gates.pipeline import Basis
from genpolicy.documents.document import Document
from genpolicy.errors import IntegrityError
from genpolicy.integrity.documents import parse_json
from genpolicy.integrity.hashing import sha256_bytes_of, sha256_file
from genpolicy.integrity.rows import (
    Row,
    check_columns,
    missing_columns,
    rows_of_table,
    unknown_columns,
)
from genpolicy.integrity.tables import table_of

Array = NDArray[np.float64]
Content = TypeVar("Content")
Made = TypeVar("Made")


class MissingEvidenceError(Exception):
    """A number cannot be measured from what is there. Never leaves the gates."""


class Evidence:
    """The evidence below one repository root, with the hash of everything touched.

    Args:
        root: Repository root.
        basis: Code, parameters and recorded runs that it stands on; none where nobody asks.
    """

    def __init__(self, root: Path, basis: Basis | None = None) -> None:
        self.root = root
        self.basis = basis or Basis()
        self._materials: dict[str, str] = {}
        self._tables: dict[str, pa.Table] = {}
        self._frames: dict[tuple[str, bool], pd.DataFrame] = {}
        self._of: dict[tuple[str, str], pd.DataFrame] = {}
        self._documents: dict[str, Any] = {}
        self._touched: dict[str, None] = {}
        self._whole: set[tuple[str, type]] = set()
        self._made: dict[Hashable, tuple[Any, list[str]]] = {}

    @property
    def materials(self) -> dict[str, str]:
        """SHA-256 of every file read or bound, by path relative to the root."""
        return dict(sorted(self._materials.items()))

    @contextlib.contextmanager
    def recorded(self) -> Iterator[list[str]]:
        """What is read inside: the list that is given holds the paths, in order, at the end."""
        before, self._touched = self._touched, {}
        paths: list[str] = []
        try:
            yield paths
        finally:
            paths += self._touched
            self._touched = {**before, **self._touched}

    def once(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """What is made of this evidence and nothing else: once for each key, then given again.

        What it read counts as read by everyone who asks. Where `make` raises, nothing is kept. Do
        not write into what is given.
        """
        if key not in self._made:
            with self.recorded() as paths:
                made = make()
            self._made[key] = made, paths
        found, read = self._made[key]
        self._touched |= dict.fromkeys(read)
        return cast(Made, found)

    def rows(self, path: str, row: type, *, lists: bool = False) -> pd.DataFrame:
        """Rows of a table of the class `row`, at least one.

        The frame is kept and given again: do not write into it.

        Args:
            path: The table.
            row: Its class.
            lists: Whether columns that hold lists come too; they take long.

        Raises:
            MissingEvidenceError: No such file or row, or a column of `row` is missing, or has
                empty cells where `row` has none; of numbers `numbers` says so.
            IntegrityError: A column that `row` does not know: other code wrote it. Or the file
                is not a whole table.
        """
        table = self._known(path, row)
        if table.num_rows == 0:
            raise MissingEvidenceError(f"{path} has no rows")
        if (path, lists) not in self._frames:
            names = [f.name for f in table.schema if lists or not pa.types.is_nested(f.type)]
            self._frames[path, lists] = table.select(names).to_pandas()
        return self._frames[path, lists]

    def of(self, path: str, row: type, method: str) -> pd.DataFrame:
        """Rows of one method; as `rows`, and kept as they are.

        Raises:
            MissingEvidenceError: No such file, column or row.
            IntegrityError: An unknown column, or no whole table.
        """
        frame = self.rows(path, row)
        if (path, method) not in self._of:
            self._of[path, method] = frame[frame["method"] == method]
        found = self._of[path, method]
        if len(found) == 0:
            raise MissingEvidenceError(f"{path} has no rows of {method}")
        return found

    def records(self, path: str, row: type[Row]) -> list[Row]:
        """All rows of a table of the class `row`, possibly none, as that class.

        Raises:
            MissingEvidenceError: No such file, or a column of `row` is missing, or has empty cells
                where `row` has none.
            IntegrityError: An unknown column, or no whole table.
        """
        table = self._known(path, row)
        _require_filled(table, _filled(row), path)
        return rows_of_table(table, row, where=path)

    def _known(self, path: str, row: type) -> pa.Table:
        """The table with the columns of its class: an unknown one refuses, by name."""
        table = self._table(path)
        if (path, row) in self._whole:
            return table
        if unknown_columns(row, table.column_names):
            check_columns(row, table.column_names, where=path)
        absent = missing_columns(row, table.column_names)
        if absent:
            raise MissingEvidenceError(f"{path} has no column {', '.join(absent)}")
        texts = {name: kind for name, kind in _filled(row).items() if kind is not float}
        _require_filled(table, texts, path)
        self._whole.add((path, row))
        return table

    def document(self, folder: str, of: Document[Content]) -> Content:
        """A JSON document as its class.

        Args:
            folder: Folder that it lies in.
            of: What kind it is.

        Raises:
            MissingEvidenceError: No such file, an unknown or missing key, or a value of another
                type.
            BadInputError: Not strict JSON.
        """
        path = f"{folder}/{of.file}"
        self._touched[path] = None
        if path not in self._documents:
            self._documents[path] = parse_json(self._read(path), where=path)
        try:
            return of.parse(self._documents[path], where=path)
        except IntegrityError as error:
            raise MissingEvidenceError(str(error)) from error

    def bind(self, *patterns: str) -> list[str]:
        """Hash files by glob pattern without reading them; returns their paths, sorted."""
        bound = []
        for pattern in patterns:
            for file in sorted(self.root.glob(pattern)):
                name = file.relative_to(self.root).as_posix()
                if name not in self._materials:
                    self._materials[name] = sha256_file(file)
                bound.append(name)
        return bound

    def bind_files(self, names: Iterable[str]) -> None:
        """Hash files by name without reading them."""
        for name in names:
            self._materials.setdefault(name, sha256_file(self.root / name))

    def digest(self, path: str) -> str:
        """SHA-256 of one file, without reading it further; empty where it is missing."""
        self._touched[path] = None
        return self._materials[path] if self.bind(path) else ""

    def content(self, path: str) -> bytes:
        """The bytes of a file that is neither a table nor a document.

        Raises:
            MissingEvidenceError: No such file.
        """
        self._touched[path] = None
        return self._read(path)

    def _table(self, path: str) -> pa.Table:
        self._touched[path] = None
        if path not in self._tables:
            self._tables[path] = table_of(self._read(path), where=path)
        return self._tables[path]

    def _read(self, path: str) -> bytes:
        file = self.root / path
        if not file.exists() and not file.is_symlink():
            raise MissingEvidenceError(f"{path} is missing")
        self._materials[path], data = sha256_bytes_of(file, keep=True)
        return data


def _filled(row: type) -> dict[str, Any]:
    """Type of every column that has a value in each row: those that are not `... | None`."""
    hints = typing.get_type_hints(row)
    kinds = {item.name: hints[item.name] for item in dataclasses.fields(row)}
    return {name: kind for name, kind in kinds.items() if not _may_be_empty(kind)}


def _may_be_empty(kind: Any) -> bool:
    return type(None) in typing.get_args(kind)


def _require_filled(table: pa.Table, columns: dict[str, Any], path: str) -> None:
    """Refuse empty cells: what groups or chooses rows would leave theirs out without a word."""
    empty = [name for name, kind in columns.items() if _has_empty(table.column(name), kind)]
    if empty:
        raise MissingEvidenceError(f"{path} has empty cells in column {', '.join(empty)}")


def _has_empty(column: pa.ChunkedArray, kind: Any) -> bool:
    if _may_be_empty(kind):
        return False
    if column.null_count > 0 or typing.get_origin(kind) is not tuple:
        return bool(column.null_count > 0)
    if not pa.types.is_nested(column.type):
        return False
    return _has_empty(pc.list_flatten(column), typing.get_args(kind)[0])


def numbers(frame: pd.DataFrame, column: str) -> Array:
    """A column as finite float64 numbers. Shape (rows,).

    Raises:
        MissingEvidenceError: Not numbers, or a value is missing, NaN or infinite.
    """
    try:
        values = np.asarray(frame[column].to_numpy(dtype=np.float64, na_value=np.nan))
    except (TypeError, ValueError) as error:
        raise MissingEvidenceError(f"column {column} holds no numbers") from error
    if not np.all(np.isfinite(values)):
        raise MissingEvidenceError(f"column {column} has missing or non-finite values")
    return values


def counts(frame: pd.DataFrame, column: str) -> Array:
    """A column that counts: `numbers` not below zero, or rows cancel each other. Shape (rows,).

    Raises:
        MissingEvidenceError: As `numbers`, or a value is below zero.
    """
    values = numbers(frame, column)
    if np.any(values < 0):
        raise MissingEvidenceError(f"column {column} counts {values.min():g}: corrupt evidence")
    return values


def flags(frame: pd.DataFrame, column: str) -> NDArray[np.bool_]:
    """A column of true or false; not reached (null) counts as false. Shape (rows,).

    Raises:
        MissingEvidenceError: Other values.
    """
    values = frame[column]
    if values.dtype == np.bool_:
        return np.asarray(values.to_numpy(copy=True))
    known = values.dropna()
    if not all(isinstance(value, bool | np.bool_) for value in known):
        raise MissingEvidenceError(f"column {column} holds other values than true and false")
    return np.asarray(values.fillna(False).astype(bool).to_numpy(), dtype=np.bool_)
