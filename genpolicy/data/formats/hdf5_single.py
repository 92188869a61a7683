"""HDF5: what belongs to the file itself, and data sets of one value a row or a demonstration.

HDF5 can read other files: external links, external storage and virtual data sets reach out of
the file, and a filter can load a library. All of them are refused before anything is read.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.leaves import (
    MAXIMUM_DEPTH,
    MAXIMUM_OBJECT,
    MAXIMUM_TEXT,
    WIDEST,
    text_of,
)
from genpolicy.data.formats.source import (
    NOT_READABLE,
    TOO_LARGE,
    Also,
    Budget,
    Column,
    refuse,
)

OBSERVATIONS = "obs"
# The observations of one row later.
AGAIN = ("next_obs",)
MOST_MEMBERS = 512
COUNT = "num_samples"
MARKUP = "<"  # the XML of a simulator's model
NO_VALUE = "no plain value of a row or of the demonstration"
MODEL = "the model of a simulator"
# Filters of the library itself: deflate, shuffle, fletcher32, szip, nbit, scale-offset, lzf.
FILTERS = (1, 2, 3, 4, 5, 6, 32000)
# What a damaged file makes the library raise.
READ_ERRORS = (OSError, KeyError, RuntimeError, ValueError, TypeError, MemoryError)
REWRITE = "Write the file again with plain, internal data sets (h5repack)."


@dataclass(frozen=True)
class Beside:
    """What was recorded of a demonstration beside what the contract reads, by name.

    Attributes:
        by_row: Values by row.
        single: Values of the demonstration, as texts that `leaves` takes apart.
        left: What is not read, and why.
    """

    by_row: dict[str, NDArray[Any]]
    single: dict[str, str]
    left: dict[str, str]


def read_single(demo: Any, read: Mapping[str, NDArray[Any]], also: Also) -> Beside:
    """Data sets beside those read, by row or one value for the whole, and attributes of groups.

    What is no plain data set of this file, or damaged, is passed over: nothing depends on it.

    Args:
        demo: Group of the demonstration.
        read: The columns that were read; all of one length.
        also: Says which to read.
    """
    found = Beside({}, {}, {})
    rows = len(next(iter(read.values()), ()))
    budget = Budget()
    for name, data in _members(demo):
        if name in read:
            continue
        try:
            if isinstance(data, h5py.Group):
                single, left = attributes_of(data)
                found.single.update({f"{name}/{key}": text for key, text in single.items()})
                found.left.update({f"{name}/{key}": why for key, why in left.items()})
            elif data is not None:
                _read_one(name, data, rows, (also, budget), found)
            else:
                found.left[name] = NOT_READABLE
        except READ_ERRORS:
            found.left[name] = NOT_READABLE
    return found


def attributes_of(group: Any) -> tuple[dict[str, str], dict[str, str]]:
    """Attributes of a group as texts, and those that are left out and why; no model's markup."""
    found: dict[str, str] = {}
    left: dict[str, str] = {}
    for name in sorted(group.attrs):
        if name == COUNT:
            continue
        try:
            value = group.attrs[name]
        except READ_ERRORS:
            left[str(name)] = NOT_READABLE
            continue
        plain = not isinstance(value, h5py.Empty) and np.size(value) <= WIDEST
        text = text_of(value) if plain else None
        why = _why_left(text)
        if text is not None and why is None:
            found[str(name)] = text
        elif why is not None:
            left[str(name)] = why
    return found, left


def _read_one(name: str, data: Any, rows: int, asked: tuple[Also, Budget], found: Beside) -> None:
    """One data set: by row, one value, a few values, or nothing that could be asked."""
    if data.shape is None:  # declared and never written
        found.left[name] = NO_VALUE
        return
    also, budget = asked
    width = int(data.shape[1]) if data.ndim == 2 else None
    plain = data.ndim <= 1 or (data.ndim == 2 and not _is_text(data))
    by_row = plain and data.ndim > 0 and rows > 1 and len(data) == rows
    if not _is_own(data) or not plain or (not by_row and not 0 < data.size <= WIDEST):
        # What was seen and is no column is named where the file is described.
        if not name.startswith(f"{OBSERVATIONS}/") and isinstance(data, h5py.Dataset):
            found.left[name] = NO_VALUE
    elif not also(Column(name, width if by_row else None)):
        return
    elif not budget.takes(data.size * max(8, data.dtype.itemsize)):
        found.left[name] = TOO_LARGE
    elif by_row:
        values = _texts(data, MAXIMUM_TEXT) if _is_text(data) else np.asarray(data[...])
        found.by_row[name] = values
    else:
        values = (_texts(data) if _is_text(data) else np.asarray(data[...])).reshape(-1)
        text = text_of(values[0] if len(values) == 1 else values)
        why = _why_left(text)
        if text is not None and why is None:
            found.single[name] = text
        elif why is not None:
            found.left[name] = why


def _why_left(text: str | None) -> str | None:
    """Why what was written is not asked; None where it is."""
    if text is None or len(text) > MAXIMUM_OBJECT:
        return NO_VALUE
    if len(text) > MAXIMUM_TEXT and text.lstrip().startswith(MARKUP):
        return MODEL
    return None


def _members(demo: Any) -> Iterator[tuple[str, Any]]:
    """Data sets and groups by their path, by hard links only, not too deep; None if damaged."""
    held: list[tuple[str, Any, int]] = [("", demo, 0)]
    seen = 0
    while held:
        prefix, group, depth = held.pop(0)
        for name in sorted(group):
            seen += 1
            if seen > MOST_MEMBERS:
                return
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                continue
            path = f"{prefix}{name}"
            try:
                member = group[name]
            except READ_ERRORS:
                yield path, None
                continue
            if isinstance(member, h5py.Dataset):
                yield path, member
            elif isinstance(member, h5py.Group) and depth < MAXIMUM_DEPTH and path not in AGAIN:
                yield path, member
                held.append((f"{path}/", member, depth + 1))


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
