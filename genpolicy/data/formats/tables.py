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
    NOT_READABLE,
    Column,
    refuse,
)
from genpolicy.data.formats.values import array_of, is_even, missing
from genpolicy.errors import BadInputError, IntegrityError

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
def open_table(
    path: Path, *, label: str, hashed: bool = True, lenient: bool = False
) -> Iterator[Table]:
    """A Parquet file, opened without following a link; bytes hashed are the bytes read.

    Its footer is read once before: what claims too much, or is no table, is never hashed.

    Args:
        path: The file.
        label: What texts call it.
        hashed: Off only where it is described and not read; the digest is empty then.
        lenient: Describe it although the first row of a list cannot be read, as reading it does.

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
                name: _column(file, name, kind, lenient=hashed or lenient)
                for name, kind in kinds.items()
                if kind is not None
            }
        except (pa.ArrowException, OSError, MemoryError, ValueError) as error:
            raise _unreadable(label, error) from error
        skipped = tuple(name for name, kind in kinds.items() if kind is None)
        yield Table(label, digest, file, columns, skipped)


def described(files: Sequence[tuple[Path, str]]) -> Table:
    """The first of some files that can be described, closed; one with a damaged list comes last.

    Args:
        files: Files with what texts call them, the likeliest first.

    Raises:
        BadInputError: What is wrong with the first, where none can be described.
    """
    first: BadInputError | None = None
    for lenient in (False, True):
        for path, label in files:
            try:
                with open_table(path, label=label, hashed=False, lenient=lenient) as table:
                    return table
            except BadInputError as error:
                first = first or error
    raise first or AssertionError("no file was tried")


def batches(
    table: Table,
    wanted: Sequence[str],
    beside: Collection[str] = (),
    left: dict[str, str] | None = None,
) -> Iterator[dict[str, NDArray[Any]]]:
    """The wanted columns, some thousand rows at a time, in the order of the file.

    Args:
        table: The file.
        wanted: Names of columns.
        beside: Those of them that nothing depends on: missing where the rows of one differ in
            width, or where it is damaged.
        left: Gets those of them that are damaged, and why.

    Raises:
        BadInputError: A column is missing, its rows differ in width, or a page is damaged.
    """
    for name in wanted:
        if name not in table.columns:
            refuse(f"{table.label}: column {name}", "missing", f"{sorted(table.columns)[:12]}")
    done = 0
    # Group by group: a damaged one must not take down the good rows before it.
    for group in range(table.file.metadata.num_row_groups):
        first = done
        try:
            for batch in _of_group(table, group, wanted, beside, done):
                done += len(next(iter(batch.values())))
                yield batch
        except BadInputError:
            damaged = {name for name in beside if not _is_whole(table, group, name)}
            if not damaged:
                raise
            if left is not None:
                left |= dict.fromkeys(sorted(damaged), NOT_READABLE)
            yield from _without(table, group, wanted, (beside, damaged), (first, done))
            done = first + int(table.file.metadata.row_group(group).num_rows)


def _of_group(
    table: Table, group: int, wanted: Sequence[str], beside: Collection[str], done: int
) -> Iterator[dict[str, NDArray[Any]]]:
    """The columns of one group of rows; `done` rows lie before it or were read of it."""
    try:
        for batch in table.file.iter_batches(
            batch_size=BATCH_ROWS, columns=list(wanted), row_groups=[group]
        ):
            yield {
                name: missing(batch.num_rows, table.columns[name])
                if name in beside and not is_even(batch.column(name), table.columns[name])
                else array_of(batch.column(name), table.columns[name], table.label, done)
                for name in wanted
            }
            done += batch.num_rows
    except (pa.ArrowException, OSError, MemoryError, UnicodeDecodeError) as error:
        raise _unreadable(table.label, error) from error


def _without(
    table: Table,
    group: int,
    wanted: Sequence[str],
    beside: tuple[Collection[str], Collection[str]],
    rows: tuple[int, int],
) -> Iterator[dict[str, NDArray[Any]]]:
    """What was not yet read of a group, with the damaged columns of it missing."""
    among, damaged = beside
    first, done = rows
    sound = [name for name in wanted if name not in damaged]
    for batch in _of_group(table, group, sound, among, first):
        length = len(next(iter(batch.values())))
        known, first = max(0, done - first), first + length
        if known < length:
            filled = batch | {name: missing(length, table.columns[name]) for name in damaged}
            yield {name: filled[name][known:] for name in wanted}


def _is_whole(table: Table, group: int, name: str) -> bool:
    """Whether all rows of one column of a group can be read."""
    try:
        return all(True for _ in _of_group(table, group, [name], [name], 0))
    except BadInputError:
        return False


def read_columns(
    table: Table,
    wanted: Sequence[str],
    beside: Collection[str] = (),
    left: dict[str, str] | None = None,
) -> dict[str, NDArray[Any]]:
    """The wanted columns of the whole file; see `batches`.

    Raises:
        BadInputError: As `batches`.
    """
    parts = list(batches(table, wanted, beside, left))
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


def _column(file: pq.ParquetFile, name: str, kind: str, *, lenient: bool) -> Column:
    if kind != "vector":
        return Column(name, None, "text" if kind == "text" else "number")
    field = file.schema_arrow.field(name)
    unit = (field.metadata or {}).get(b"unit", b"").decode("utf-8", errors="replace")
    if pa.types.is_fixed_size_list(field.type):
        return Column(name, int(field.type.list_size), unit=unit)
    try:
        first = next(file.iter_batches(batch_size=1, columns=[name]), None)
    except (pa.ArrowException, OSError, MemoryError):
        if not lenient:
            raise
        # Refused as damaged where it is needed; nothing may depend on it.
        first = None
    value = first.column(0)[0].as_py() if first is not None and first.num_rows else None
    return Column(name, len(value or ()), unit=unit)


def _unreadable(label: str, error: Exception) -> IntegrityError:
    return IntegrityError(
        where=label,
        found=f"not a readable table ({' '.join(str(error).split())[:160]})",
        expected="a whole Parquet file",
        action=FETCH,
    )
