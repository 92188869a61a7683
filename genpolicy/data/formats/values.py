"""Values of a Parquet column as numpy's: numbers and texts, one or several a row."""

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from genpolicy.data.formats.source import Column, refuse


def array_of(values: pa.Array, column: Column, label: str, done: int) -> NDArray[Any]:
    """The values as numpy's; (n,), or (n, width).

    Args:
        values: Some rows of a column.
        column: What it should be.
        label: What texts call the file.
        done: Rows before these.

    Raises:
        ContractError: Rows are missing or differ in width.
    """
    where = f"{label}: {column.name}"
    if pa.types.is_dictionary(values.type):
        values = values.dictionary_decode()
    if column.kind == "text":
        return np.array(["" if v is None else v for v in values.to_pylist()], dtype=object)
    if column.width is None:
        return _scalars(values)
    if values.null_count:
        row = done + values.is_null().to_pylist().index(True)
        refuse(f"{where}, row {row}", "null", f"{column.width} numbers")
    flat = values.flatten()
    if not pa.types.is_fixed_size_list(values.type):
        lengths = np.asarray(values.value_lengths())
        if (lengths != column.width).any():
            row = int(np.argmax(lengths != column.width))
            found = f"{lengths[row]} numbers wide"
            refuse(f"{where}, row {done + row}", found, f"{column.width}, as in the first row")
    return _scalars(flat).reshape(len(values), column.width)


def is_even(values: pa.Array, column: Column) -> bool:
    """Whether all rows of a column are of its width."""
    if column.width is None or pa.types.is_fixed_size_list(values.type):
        return column.width is None or values.null_count == 0
    return not values.null_count and bool(
        (np.asarray(values.value_lengths()) == column.width).all()
    )


def missing(rows: int, column: Column) -> NDArray[Any]:
    """So many rows in which nothing was recorded."""
    if column.kind == "text":
        return np.full(rows, "", dtype=object)
    return np.full(rows if column.width is None else (rows, column.width), np.nan)


def _scalars(values: pa.Array) -> NDArray[Any]:
    """Numbers; a null becomes NaN, which the checks refuse by row."""
    if pa.types.is_timestamp(values.type):
        values = values.cast(pa.timestamp("ns")).cast(pa.int64())
    if pa.types.is_boolean(values.type):
        values = values.cast(pa.uint8())
    return np.asarray(values.to_numpy(zero_copy_only=False))
