"""Parquet with page checksums on both ways: a flipped bit is an error, never another number."""

import io
import os
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.hashing import sha256_bytes_of

MAXIMUM_TABLE_BYTES = 4 << 30


def write_table(path: Path, table: pa.Table) -> None:
    """Write a table, whole or not at all; the same table gives the same bytes.

    Raises:
        BadInputError: The place cannot be written.
    """
    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True)
    write_bytes(path, sink.getvalue())


def read_table(path: Path) -> pa.Table:
    """Read a whole table with its checksums verified.

    Raises:
        BadInputError: Missing, truncated, changed, or larger in memory than the cap.
    """
    return table_of(sha256_bytes_of(path, keep=True)[1], where=os.fspath(path))


def table_of(data: bytes, *, where: str) -> pa.Table:
    """The table in the bytes of one Parquet file.

    Raises:
        BadInputError: Not Parquet, truncated, changed, or larger in memory than the cap.
    """
    try:
        file = pq.ParquetFile(io.BytesIO(data), page_checksum_verification=True)
        _check_size(file, where)
        return file.read()
    except (pa.ArrowException, OSError, MemoryError) as error:
        raise IntegrityError(
            where=where,
            found=f"not a readable table ({' '.join(str(error).split())[:200]})",
            expected="a whole Parquet file with matching checksums",
            action="Run the stage that writes it again (`dvc repro`).",
        ) from error


def _check_size(file: pq.ParquetFile, where: str) -> None:
    width = sum(_bytes_per_value(field.type) for field in file.schema_arrow)
    needed = file.metadata.num_rows * width
    if needed > MAXIMUM_TABLE_BYTES:
        raise BadInputError(
            where=where,
            found=f"a table of about {needed} bytes in memory",
            expected=f"at most {MAXIMUM_TABLE_BYTES}",
            action="Split the file, or check that it is what it claims to be.",
        )


def _bytes_per_value(kind: pa.DataType) -> int:
    if pa.types.is_fixed_size_list(kind):
        return int(kind.list_size) * _bytes_per_value(kind.value_type)
    try:
        return max(1, int(kind.bit_width) // 8)
    except ValueError:
        return 8
