"""Is this file whole? Told by its first and last bytes, before a byte of it is hashed.

A copy that was cut off, or a file of another kind under this name, is told at once whatever its
size. What the readers check is more; this costs two reads.

Sources: Parquet file layout (length of the footer and magic at the end); HDF5 file format
specification, section II.A (superblock, address of the end of the file); MCAP specification.
"""

import os
from pathlib import Path
from typing import BinaryIO, NoReturn

from genpolicy.data.formats.detect import (
    HDF5_MAGIC,
    MCAP_MAGIC,
    PARQUET_MAGIC,
    only_hdf5,
    refuse_unreadable,
)
from genpolicy.errors import IntegrityError

FIRST_USER_BLOCK = 512
LARGEST_TAIL = 2**20  # bytes behind the stated end that a writer may have reserved
# Where a superblock of each version keeps the size of addresses, and the first address; the third
# is that of the end.
ADDRESS_SIZE_AT = {0: 13, 1: 13, 2: 9, 3: 9}
ADDRESSES_AT = {0: 24, 1: 28, 2: 12, 3: 12}


def check_ends(path: Path, layout: str) -> None:
    """Refuse a file whose ends are not those of its layout; a folder of many is left to its reader.

    Args:
        path: File, or folder.
        layout: Its layout, as `detect` names it.

    Raises:
        IntegrityError: Empty, of another kind, or cut off.
        BadInputError: Not readable.
    """
    check = CHECKS.get(layout)
    try:
        path = only_hdf5(path) if layout == "robomimic" else path
        if check is None or not path.is_file():
            return
        size = path.stat().st_size
        if size == 0:
            _refuse(path, "empty", f"a {layout} file")
        with path.open("rb") as stream:
            check(path, stream, size)
    except OSError as error:
        refuse_unreadable(path, error)


def _parquet(path: Path, stream: BinaryIO, size: int) -> None:
    if stream.read(4) != PARQUET_MAGIC:
        _refuse(path, "a file that does not begin as Parquet", "the magic bytes PAR1")
    tail = _at(stream, max(0, size - 8), 8)
    if tail[4:] != PARQUET_MAGIC or not 0 < int.from_bytes(tail[:4], "little") <= size - 12:
        _refuse(path, f"cut off: {size} bytes without a footer", "a whole Parquet file")


def _mcap(path: Path, stream: BinaryIO, size: int) -> None:
    if stream.read(len(MCAP_MAGIC)) != MCAP_MAGIC:
        _refuse(path, "a file that does not begin as MCAP", "the MCAP magic bytes")
    if _at(stream, max(0, size - len(MCAP_MAGIC)), len(MCAP_MAGIC)) != MCAP_MAGIC:
        _refuse(path, "cut off or still being written", "the closing MCAP magic bytes")


def _hdf5(path: Path, stream: BinaryIO, size: int) -> None:
    start = 0
    while _at(stream, start, len(HDF5_MAGIC)) != HDF5_MAGIC:
        # A block of the user's own may stand before it: 512 bytes, or 1024, 2048, …
        start = max(FIRST_USER_BLOCK, 2 * start)
        if start >= size:
            _refuse(path, "a file that does not begin as HDF5", "the HDF5 magic bytes")
    block = _at(stream, start, 64).ljust(64, b"\0")
    version = block[8]
    if version not in ADDRESSES_AT:
        _refuse(path, f"an HDF5 file of superblock version {version}", f"one of {[*ADDRESSES_AT]}")
    width = block[ADDRESS_SIZE_AT[version]]
    place = ADDRESSES_AT[version] + 2 * width
    end = int.from_bytes(block[place : place + width], "little")
    if not (0 < width <= 8 and 0 < end <= size):
        _refuse(path, f"cut off: {size} bytes", f"{end} bytes, as its superblock says")
    if size - start - end > LARGEST_TAIL:  # it would be hashed, and none of it read
        _refuse(path, f"{size} bytes long", f"{end} bytes, as its superblock says")


CHECKS = {"parquet": _parquet, "mcap": _mcap, "robomimic": _hdf5}


def _at(stream: BinaryIO, start: int, length: int) -> bytes:
    stream.seek(start, os.SEEK_SET)
    return stream.read(length)


def _refuse(path: Path, found: str, expected: str) -> NoReturn:
    raise IntegrityError(
        where=str(path), found=found, expected=expected, action="Fetch or write the file again."
    )
