"""Tables as dataclasses: field order is column order, and an annotation gives the arrow type.

A column is spelled once, in the class of its row. Who writes builds rows, so that a misspelt
column is a type error; who reads refuses a table with other columns by name.
"""

import functools
import types
import typing
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

import pyarrow as pa

from genpolicy.errors import ContractError, IntegrityError
from genpolicy.integrity.tables import read_table, write_table

Row = TypeVar("Row")

SCALARS = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}


def columns_of(row: type) -> tuple[str, ...]:
    """Names of the columns, in order."""
    return tuple(schema_of(row).names)


def schema_of(row: type) -> pa.Schema:
    """The arrow schema of a row class.

    Args:
        row: A dataclass whose fields are str, int, float, bool, tuples of those (lists of any
            length), or one of these or None.

    Raises:
        ContractError: Not a dataclass, or a field of another type.
    """
    return _schema_of(row)


@functools.cache
def _schema_of(row: type) -> pa.Schema:
    if not is_dataclass(row):
        raise _wrong(row.__name__, "a class that is no dataclass")
    hints = typing.get_type_hints(row)
    return pa.schema(
        [
            (item.name, _arrow(hints[item.name], f"{row.__name__}.{item.name}"))
            for item in fields(row)
        ]
    )


def table_of_rows(row: type[Row], rows: Sequence[Row]) -> pa.Table:
    """The rows as a table of `schema_of(row)`, in their order; no rows give an empty table."""
    return pa.table(
        {name: [getattr(item, name) for item in rows] for name in columns_of(row)},
        schema=schema_of(row),
    )


def write_rows(path: Path, row: type[Row], rows: Sequence[Row]) -> None:
    """Write rows as Parquet, whole or not at all; the same rows give the same bytes.

    Raises:
        BadInputError: The place cannot be written.
    """
    write_table(path, table_of_rows(row, rows))


def read_rows(path: Path, row: type[Row]) -> list[Row]:
    """Rows of a file that `write_rows` wrote.

    Raises:
        IntegrityError: Unknown or missing columns.
        BadInputError: Missing, truncated or changed.
    """
    return rows_of_table(read_table(path), row, where=str(path))


def read_columns(path: Path, row: type) -> pa.Table:
    """The table of a file that `write_rows` wrote, for who computes by columns; as `read_rows`."""
    table = read_table(path)
    check_columns(row, table.column_names, where=str(path))
    return table


def rows_of_table(table: pa.Table, row: type[Row], *, where: str) -> list[Row]:
    """The rows of a table as their class, lists as tuples.

    Raises:
        IntegrityError: Unknown or missing columns.
    """
    check_columns(row, table.column_names, where=where)
    return [row(**_frozen(values)) for values in table.to_pylist()]


def unknown_columns(row: type, names: Iterable[str]) -> list[str]:
    """Columns of a table that its row class does not know.

    A class variable `FAMILIES` names beginnings of columns of which a table may have any number.
    """
    wanted, families = columns_of(row), tuple(getattr(row, "FAMILIES", ()))
    return [name for name in names if name not in wanted and not name.startswith(families)]


def missing_columns(row: type, names: Iterable[str]) -> list[str]:
    """Columns of the row class that a table lacks."""
    have = set(names)
    return [name for name in columns_of(row) if name not in have]


def check_columns(row: type, names: Iterable[str], *, where: str) -> None:
    """Refuse a table whose columns are not those of the row class, by name.

    Args:
        row: The row class.
        names: Columns of the table.
        where: The table, for the message.

    Raises:
        IntegrityError: Unknown or missing columns.
    """
    have = list(names)
    unknown, missing = unknown_columns(row, have), missing_columns(row, have)
    if unknown or missing:
        found = [
            f"{kind} column{'s' if len(some) > 1 else ''} {', '.join(some)}"
            for kind, some in (("unknown", unknown), ("missing", missing))
            if some
        ]
        raise IntegrityError(
            where=where,
            found=" and ".join(found),
            expected=f"the columns of {row.__name__}",
            action="Run the stage that writes it again (`dvc repro`).",
        )


def _frozen(values: dict[str, Any]) -> dict[str, Any]:
    return {name: _tuples(value) for name, value in values.items()}


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


def _arrow(kind: Any, where: str) -> pa.DataType:
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        known = [part for part in typing.get_args(kind) if part is not type(None)]
        if len(known) == 1:
            return _arrow(known[0], where)
    elif typing.get_origin(kind) is tuple:
        inner = typing.get_args(kind)
        if len(inner) == 2 and inner[1] is Ellipsis:
            return pa.list_(_arrow(inner[0], where))
    elif kind in SCALARS:
        return SCALARS[kind]
    raise _wrong(where, repr(kind))


def _wrong(where: str, found: str) -> ContractError:
    return ContractError(
        where=where,
        found=found,
        expected="a dataclass of str, int, float, bool, tuples of those, or one of them or None",
        action="Give the column one of these types.",
    )
