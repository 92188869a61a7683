"""Parquet files of others: hashed, checked before they are decoded, read in batches."""

import io
import os
import stat
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from genpolicy.data.formats.contract import MAXIMUM_WIDTH
from genpolicy.data.formats.source import (
    MAXIMUM_SOURCE_ROWS,
    MAXIMUM_VALUE_BYTES,
    Column,
    refuse,
)
from genpolicy.errors import IntegrityError

BATCH_ROWS = 4096
HASH_BYTES = 1 << 20
SPLIT_FILE = "Split the file, or check that it is what it claims to be."
FETCH = "Fetch or write the file again."


@dataclass(frozen=True)
class Table:
    """An open Parquet file.

    Attributes:
        label: What texts call it.
        digest: SHA-256 of the very bytes that are read.
        file: The reader.
        columns: Its columns that are numbers or text, by name.
        skipped: Its other columns.
    """

    label: str
    digest: str
    file: pq.ParquetFile
    columns: dict[str, Column]
    skipped: tuple[str, ...]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self.file.metadata.num_rows)


@contextmanager
def open_table(path: Path, *, label: str, hashed: bool = True) -> Iterator[Table]:
    """A Parquet file, opened without following a link; bytes hashed are the bytes read.

    Its footer is read once before: what claims too much, or is no table, is never hashed.

    Args:
        path: The file.
        label: What texts call it.
        hashed: Off only where it is described and not read; the digest is empty then.

    Raises:
        BadInputError: Missing, a link, not Parquet, or larger in memory than the caps.
    """
    with _open(path, label) as stream:
        digest = _digest(stream, label) if hashed else ""
        try:
            file = pq.ParquetFile(stream, page_checksum_verification=True)
            kinds = _kinds(file)
            _check_size(file, label)
            columns = {
                name: _column(file, name, kind) for name, kind in kinds.items() if kind is not None
            }
        except (pa.ArrowException, OSError, MemoryError, ValueError) as error:
            raise _unreadable(label, error) from error
        skipped = tuple(name for name, kind in kinds.items() if kind is None)
        yield Table(label, digest, file, columns, skipped)


def batches(
    table: Table, wanted: Sequence[str], beside: Collection[str] = ()
) -> Iterator[dict[str, NDArray[Any]]]:
    """The wanted columns, some thousand rows at a time, in the order of the file.

    Args:
        table: The file.
        wanted: Names of columns.
        beside: Those of them that nothing depends on: NaN where the rows of one differ in width.

    Raises:
        BadInputError: A column is missing, its rows differ in width, or a page is damaged.
    """
    for name in wanted:
        if name not in table.columns:
            refuse(f"{table.label}: column {name}", "missing", f"{sorted(table.columns)[:12]}")
    done = 0
    try:
        # Group by group: a damaged one must not take down the good rows before it.
        for group in range(table.file.metadata.num_row_groups):
            for batch in table.file.iter_batches(
                batch_size=BATCH_ROWS, columns=list(wanted), row_groups=[group]
            ):
                yield {
                    name: _missing(batch.column(name), table.columns[name])
                    if name in beside and not _is_even(batch.column(name), table.columns[name])
                    else _array(batch.column(name), table.columns[name], table.label, done)
                    for name in wanted
                }
                done += batch.num_rows
    except (pa.ArrowException, OSError, MemoryError) as error:
        raise _unreadable(table.label, error) from error


def read_columns(
    table: Table, wanted: Sequence[str], beside: Collection[str] = ()
) -> dict[str, NDArray[Any]]:
    """The wanted columns of the whole file; see `batches`.

    Raises:
        BadInputError: As `batches`.
    """
    parts = list(batches(table, wanted, beside))
    return {
        name: np.concatenate([part[name] for part in parts]) if parts else np.zeros(0)
        for name in wanted
    }


def documents(table: Table, wanted: Sequence[str]) -> Iterator[dict[str, Any]]:
    """The rows one by one, with lists and mappings as they are.

    Raises:
        BadInputError: A page is damaged.
    """
    try:
        for batch in table.file.iter_batches(batch_size=BATCH_ROWS, columns=list(wanted)):
            yield from batch.to_pylist()
    except (pa.ArrowException, OSError, MemoryError, ValueError) as error:
        raise _unreadable(table.label, error) from error


def is_plain(kind: pa.DataType) -> bool:
    """Whether values are numbers, texts, truth values, moments, or lists and mappings of those."""
    if pa.types.is_dictionary(kind) or pa.types.is_list(kind) or pa.types.is_large_list(kind):
        return is_plain(kind.value_type)
    if pa.types.is_fixed_size_list(kind):
        return is_plain(kind.value_type)
    if pa.types.is_struct(kind):
        return all(is_plain(kind.field(k).type) for k in range(kind.num_fields))
    text = pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_null(kind)
    return text or _is_number(kind) or pa.types.is_date(kind) or pa.types.is_time(kind)


def _digest(stream: io.BufferedReader, label: str) -> str:
    """SHA-256 of the whole file, once its footer has been believed."""
    try:
        file = pq.ParquetFile(stream)
        _kinds(file)
        _check_size(file, label)
    except (pa.ArrowException, OSError, MemoryError, ValueError) as error:
        raise _unreadable(label, error) from error
    stream.seek(0)
    digest = sha256()
    while block := stream.read(HASH_BYTES):
        digest.update(block)
    stream.seek(0)
    return digest.hexdigest()


@contextmanager
def _open(path: Path, label: str) -> Iterator[io.BufferedReader]:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        raise IntegrityError(
            where=label,
            found=f"not readable ({getattr(error, 'strerror', None) or error})",
            expected="a regular file, not a link",
            action=FETCH,
        ) from error
    with os.fdopen(descriptor, "rb") as stream:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            refuse(label, "a folder or a device", "a regular file", FETCH)
        yield stream


def _kinds(file: pq.ParquetFile) -> dict[str, str | None]:
    """`scalar`, `vector`, `text` or None by column; the first of two equal names refuses."""
    kinds: dict[str, str | None] = {}
    for field in file.schema_arrow:
        if field.name in kinds:
            raise ValueError(f"the column {field.name!r} stands twice")
        kinds[field.name] = _kind(field.type)
    return kinds


def _kind(kind: pa.DataType) -> str | None:
    if pa.types.is_dictionary(kind):
        kind = kind.value_type
    if _is_number(kind):
        return "scalar"
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        return "text"
    lists = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
    if any(is_list(kind) for is_list in lists) and _is_number(kind.value_type):
        return "vector"
    return None


def _is_number(kind: pa.DataType) -> bool:
    checks = (pa.types.is_integer, pa.types.is_floating, pa.types.is_boolean)
    return any(check(kind) for check in checks) or pa.types.is_timestamp(kind)


def _check_size(file: pq.ParquetFile, label: str) -> None:
    """A few hundred kB can claim billions of rows: the claim is checked, not the file size."""
    metadata = file.metadata
    if metadata.num_rows > MAXIMUM_SOURCE_ROWS:
        refuse(label, f"{metadata.num_rows} rows", f"at most {MAXIMUM_SOURCE_ROWS}", SPLIT_FILE)
    for group in range(metadata.num_row_groups):
        rows = metadata.row_group(group).num_rows
        for index in range(metadata.num_columns):
            chunk = metadata.row_group(group).column(index)
            most = max(rows, 1) * MAXIMUM_WIDTH
            too_long = chunk.num_values > most or chunk.num_values * 8 > MAXIMUM_VALUE_BYTES
            if too_long or chunk.total_uncompressed_size > MAXIMUM_VALUE_BYTES:
                found = f"{chunk.num_values} values in {rows} rows"
                refuse(f"{label}: {chunk.path_in_schema}", found, "a bounded size", SPLIT_FILE)


def _column(file: pq.ParquetFile, name: str, kind: str) -> Column:
    if kind != "vector":
        return Column(name, None, "text" if kind == "text" else "number")
    field = file.schema_arrow.field(name)
    unit = (field.metadata or {}).get(b"unit", b"").decode("utf-8", errors="replace")
    if pa.types.is_fixed_size_list(field.type):
        return Column(name, int(field.type.list_size), unit=unit)
    first = next(file.iter_batches(batch_size=1, columns=[name]), None)
    value = first.column(0)[0].as_py() if first is not None and first.num_rows else None
    return Column(name, len(value or ()), unit=unit)


def _array(values: pa.Array, column: Column, label: str, done: int) -> NDArray[Any]:
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


def _is_even(values: pa.Array, column: Column) -> bool:
    """Whether all rows of a column are of its width."""
    if column.width is None or pa.types.is_fixed_size_list(values.type):
        return column.width is None or values.null_count == 0
    return not values.null_count and bool(
        (np.asarray(values.value_lengths()) == column.width).all()
    )


def _missing(values: pa.Array, column: Column) -> NDArray[Any]:
    return np.full((len(values), column.width or 0), np.nan)


def _scalars(values: pa.Array) -> NDArray[Any]:
    """Numbers; a null becomes NaN, which the checks refuse by row."""
    if pa.types.is_timestamp(values.type):
        values = values.cast(pa.timestamp("ns")).cast(pa.int64())
    if pa.types.is_boolean(values.type):
        values = values.cast(pa.uint8())
    return np.asarray(values.to_numpy(zero_copy_only=False))


def _unreadable(label: str, error: Exception) -> IntegrityError:
    return IntegrityError(
        where=label,
        found=f"not a readable table ({' '.join(str(error).split())[:160]})",
        expected="a whole Parquet file",
        action=FETCH,
    )
