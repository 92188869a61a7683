"""HDF5: what belongs to the file itself, and data sets of one value a row or a demonstration.

HDF5 can read other files: external links, external storage and virtual data sets reach out of
the file, and a filter can load a library. All of them are refused before anything is read.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.leaves import MAXIMUM_TEXT, leaves
from genpolicy.data.formats.source import Also, Column, refuse

OBSERVATIONS = "obs"
# Filters of the library itself: deflate, shuffle, fletcher32, szip, nbit, scale-offset, lzf.
FILTERS = (1, 2, 3, 4, 5, 6, 32000)
REWRITE = "Write the file again with plain, internal data sets (h5repack)."


def read_single(
    demo: Any, read: dict[str, NDArray[Any]], columns: Sequence[Column], also: Also
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Data sets of one axis beside those read: by row, and one value for the whole.

    What is no plain data set of this file is passed over: nothing depends on it.

    Args:
        demo: Group of the demonstration.
        read: The columns that were read; all of one length.
        columns: What the file was described with.
        also: Says which to read.

    Returns:
        Values by row, and values of the demonstration as text, by name.
    """
    rows = len(next(iter(read.values()), ()))
    wide = {column.name for column in columns if column.width is not None}
    by_row: dict[str, NDArray[Any]] = {}
    single: dict[str, str] = {}
    for name, data in _plain(demo):
        if name in read or name in wide or not also(Column(name, None)):
            continue
        if data.ndim == 1 and len(data) == rows and rows > 1:
            by_row[name] = _texts(data, MAXIMUM_TEXT) if _is_text(data) else np.asarray(data[...])
        elif data.size == 1:
            values = _texts(data) if _is_text(data) else np.asarray(data[...])
            single |= leaves(name, str(values.reshape(-1)[0]))
    return by_row, single


def _plain(demo: Any) -> Iterator[tuple[str, Any]]:
    """Data sets of at most one axis, numbers or text, of the demonstration and what it saw."""
    groups = [("", demo)]
    link = demo.get(OBSERVATIONS, getlink=True) if OBSERVATIONS in set(demo) else None
    if isinstance(link, h5py.HardLink) and isinstance(demo[OBSERVATIONS], h5py.Group):
        groups.append((f"{OBSERVATIONS}/", demo[OBSERVATIONS]))
    for prefix, group in groups:
        for name in sorted(group):
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                continue
            data = group[name]
            if isinstance(data, h5py.Dataset) and data.ndim <= 1 and _is_own(data):
                yield f"{prefix}{name}", data


def _is_own(data: Any) -> bool:
    text = h5py.check_string_dtype(data.dtype) is not None
    return (text or data.dtype.kind in "fiub") and foreign(data) is None


def _is_text(data: Any) -> bool:
    return data.dtype.kind in "SO"


def _texts(data: Any, longest: int | None = None) -> NDArray[Any]:
    values = np.asarray(data[...]).reshape(-1)
    texts = [v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v) for v in values]
    return np.array([text[:longest] for text in texts], dtype=object)


def member(group: Any, name: str, where: str) -> Any:
    """A member by a hard link, part by part; every other link is refused unresolved."""
    found = group
    for part in name.split("/"):
        link = found.get(part, getlink=True) if isinstance(found, h5py.Group) else None
        if link is None:
            refuse(f"{where}: {name}", "missing", "as in the other demonstrations")
        if not isinstance(link, h5py.HardLink):
            refuse(f"{where}: {name}", f"a {type(link).__name__}", "data in this file", REWRITE)
        found = found[part]
    return found


def check_storage(data: Any, place: str) -> None:
    """Refuse a data set that reaches out of its file, or that a foreign filter wrote.

    Raises:
        ContractError: Names the data set.
    """
    found = foreign(data)
    if found is not None:
        refuse(place, *found, REWRITE)


def foreign(data: Any) -> tuple[str, str] | None:
    """What of a data set is not in this file or not of the library, and what should be."""
    properties = data.id.get_create_plist()
    codes = [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
    if data.external or properties.get_external_count():
        return "stored in another file", "data in this file"
    if data.is_virtual:
        return "a virtual data set", "data in this file"
    if not set(codes) <= set(FILTERS):
        return f"compressed by the filters {codes}", f"some of {FILTERS}"
    return None
