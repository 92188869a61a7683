"""One zarr array, version 2 or 3: described without decoding, and decoded whole.

zarr fills missing chunks with zeros and can name codecs that unpickle; both are refused before
anything is decoded.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import zarr
from numpy.typing import NDArray

from genpolicy.data.formats.leaves import text_of
from genpolicy.data.formats.source import Column
from genpolicy.errors import BadInputError, ContractError, IntegrityError
from genpolicy.integrity.documents import read_json

MAXIMUM_ARRAY_BYTES = 1 << 30
BLOCK_ROWS = 4096
NUMERIC_TYPES = ("<f4", "<f8", "<i4", "<i8", "<i2", "<u2", "<u4", "|i1", "|u1", "|b1")
# Version 3 names the same types in words; byte order is a codec there.
IN_WORDS = {
    "float32": "<f4", "float64": "<f8", "int8": "|i1", "int16": "<i2", "int32": "<i4",
    "int64": "<i8", "uint8": "|u1", "uint16": "<u2", "uint32": "<u4", "bool": "|b1",
}  # fmt: skip
TEXT = "<U"
COMPRESSORS = ("blosc", "zstd", "zlib", "lz4")
PLAIN_CODECS = {"bytes", "blosc", "zstd", "gzip", "crc32c"}
ACTION = "Fetch the buffer again, or leave this episode out."
ARRAY_FILES = (".zarray", "zarr.json")


def is_array(folder: Path) -> bool:
    """Whether a folder is described as an array."""
    return (folder / ".zarray").is_file() or _node(folder) == "array"


def is_group(folder: Path) -> bool:
    """Whether a folder is described as a group."""
    return (folder / ".zgroup").is_file() or _node(folder) == "group"


def arrays_below(folder: Path) -> dict[str, Path]:
    """Every array below a group by its path in it, in order of the paths."""
    found: dict[str, Path] = {}
    for name in ARRAY_FILES:
        for file in folder.rglob(name):
            if is_array(file.parent):
                found[file.parent.relative_to(folder).as_posix()] = file.parent
    return dict(sorted(found.items()))


def attributes_of(folder: Path) -> dict[str, str]:
    """What a group carries beside its arrays, as texts that `leaves` takes apart."""
    said = {str(name): text_of(value) for name, value in document_of(folder).items()}
    return {name: text for name, text in said.items() if text is not None}


def document_of(folder: Path) -> dict[str, Any]:
    """The attributes of a group, as they were written."""
    document: Any = {}
    if (folder / ".zattrs").is_file():
        document = read_json(folder / ".zattrs")
    elif (folder / "zarr.json").is_file():
        document = read_json(folder / "zarr.json").get("attributes", {})
    return document if isinstance(document, dict) else {}


def column_of(name: str, folder: Path) -> Column | None:
    """An array as a column; None for pictures and other arrays of more than two axes."""
    head = head_of(folder)
    if not (isinstance(head["shape"], list) and 1 <= len(head["shape"]) <= 2):
        return None
    check_head(head, str(folder))
    width = int(head["shape"][1]) if len(head["shape"]) == 2 else None
    if str(head["dtype"]).startswith(TEXT):
        return Column(name, width, "text")
    return Column(name, width)


def head_of(folder: Path) -> dict[str, Any]:
    """The description of an array in the words of version 2."""
    if not (folder / ".zarray").is_file() and (folder / "zarr.json").is_file():
        return _third(folder)
    head = read_json(folder / ".zarray")
    keys = ("dtype", "shape", "compressor", "filters", "zarr_format")
    if not isinstance(head, dict) or any(key not in head for key in keys):
        refuse(f"{folder}/.zarray", "not an array description", f"the keys {keys}")
    return head


def check_head(head: Mapping[str, Any], place: str) -> None:
    """Plain numbers of a bounded size, in a codec that runs no foreign code."""
    try:
        kind, shape, compressor = head["dtype"], list(head["shape"]), head["compressor"]
        size = math.prod(int(n) for n in shape) * int(str(kind)[2:])
        text = str(kind).startswith(TEXT) and len(shape) == 1
        codec = None if compressor is None else compressor["id"]
        known = kind in NUMERIC_TYPES or text
        plain = known and not head["filters"] and head["zarr_format"] in (2, 3)
    except (KeyError, TypeError, ValueError) as error:
        raise ContractError(
            where=f"{place}/.zarray",
            found=f"not an array description ({error!r:.80})",
            expected="zarr version 2 or 3",
            action=ACTION,
        ) from error
    if not plain or codec not in (None, *COMPRESSORS):
        refuse(f"{place}/.zarray", f"of type {kind!r:.20}, codec {codec!r:.20}", "plain numbers")
    if not (0 < size <= MAXIMUM_ARRAY_BYTES and all(int(n) > 0 for n in shape)):
        refuse(place, f"{size} bytes", f"1 to {MAXIMUM_ARRAY_BYTES}")


def read_array(folder: Path, *, filled: bool = False) -> NDArray[Any]:
    """A whole array, its description checked before it is decoded.

    Args:
        folder: The array.
        filled: Whether a chunk that is not there holds the fill value instead of being lost.
    """
    with _decoding(folder):
        return np.asarray(_open(folder, filled=filled)[:])


def has_gaps(folder: Path) -> bool:
    """Whether chunks of an array are not there: lost, or of the fill value alone."""
    head = head_of(folder)
    with _decoding(folder):
        array = zarr.open_array(str(folder), mode="r", zarr_format=head["zarr_format"])
        return bool(array.nchunks_initialized != array.nchunks)


def slices(folder: Path, ends: Sequence[int]) -> Iterator[NDArray[Any]]:
    """The rows of each episode, decoded block by block: the whole array is never in memory.

    A chunk that is not there holds the fill value, as zarr writes flags that are all zero.

    Args:
        folder: The array.
        ends: Row behind each episode, rising.
    """
    with _decoding(folder):
        array = _open(folder, filled=True)
        step = int(array.chunks[0]) * max(1, BLOCK_ROWS // int(array.chunks[0]))
        held: NDArray[Any] = np.asarray(array[:0])
        first = 0
        for end in ends:
            parts, stop = [held], first + len(held)
            while stop < end:
                parts.append(np.asarray(array[stop : stop + step]))
                stop += step
            joined = np.concatenate(parts)
            yield joined[: end - first]
            held, first = joined[end - first :], end


def largest_block(folder: Path) -> int:
    """Bytes of what is decoded at once of an array of two axes."""
    head = head_of(folder)
    with _decoding(folder):
        array = zarr.open_array(str(folder), mode="r", zarr_format=head["zarr_format"])
        rows = max(int(array.chunks[0]), BLOCK_ROWS)
        return rows * math.prod(array.shape[1:]) * int(array.dtype.itemsize)


def _open(folder: Path, *, filled: bool) -> zarr.Array[Any]:
    place, head = str(folder), head_of(folder)
    check_head(head, place)
    array = zarr.open_array(place, mode="r", zarr_format=head["zarr_format"])
    if not filled and array.nchunks_initialized != array.nchunks:
        refuse(place, f"{array.nchunks_initialized} chunks", f"all {array.nchunks} of them")
    return array


@contextmanager
def _decoding(folder: Path) -> Iterator[None]:
    try:
        yield
    except BadInputError:
        raise
    except Exception as error:  # decoders raise whatever they like on changed bytes
        raise IntegrityError(
            where=str(folder),
            found=f"not decodable ({' '.join(str(error).split())[:120]})",
            expected="whole chunks",
            action=ACTION,
        ) from error


def _third(folder: Path) -> dict[str, Any]:
    """The description of an array of version 3, in the words of version 2."""
    document, place = read_json(folder / "zarr.json"), f"{folder}/zarr.json"
    codecs = document.get("codecs") if isinstance(document, dict) else None
    if not isinstance(codecs, list) or not all(isinstance(item, dict) for item in codecs):
        refuse(place, "not an array description", "a list of codecs")
    names = [str(item.get("name")) for item in codecs]
    strange = [name for name in names if name not in PLAIN_CODECS]
    kind = document.get("data_type")
    if strange or not isinstance(kind, str) or kind not in IN_WORDS:
        refuse(place, f"of type {kind!r:.20}, codec {strange or names!r}", "plain numbers")
    return {
        "dtype": IN_WORDS[kind], "shape": document.get("shape"), "compressor": None,
        "filters": None, "zarr_format": 3,
    }  # fmt: skip


def _node(folder: Path) -> str:
    if not (folder / "zarr.json").is_file():
        return ""
    document = read_json(folder / "zarr.json")
    return str(document.get("node_type", "")) if isinstance(document, dict) else ""


def refuse(where: str, found: str, expected: str, action: str = ACTION) -> NoReturn:
    """Raise the error of an array that is not what it should be."""
    raise ContractError(where=where, found=found, expected=expected, action=action)
