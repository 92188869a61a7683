"""What a replay buffer recorded beside the arrays that the contract reads.

By row or by episode, one number or several, in `data`, in `meta` or as attributes of a group.
Nothing depends on it: what cannot be read is named and refuses nothing.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.leaves import WIDEST, text_of
from genpolicy.data.formats.source import (
    NOT_READABLE,
    TOO_LARGE,
    Also,
    Budget,
    Column,
    bytes_of,
)
from genpolicy.data.formats.zarr_arrays import (
    column_of,
    document_of,
    has_gaps,
    head_of,
    largest_block,
    read_array,
    slices,
)
from genpolicy.errors import BadInputError

NO_NUMBERS, OTHER_LENGTH = "no plain columns", "of another length than the episodes"
PLACES = ("", "meta", "data", "info")


@dataclass(frozen=True)
class Described:
    """Arrays beside those of the contract, by name.

    Attributes:
        by_row: Columns and folders of those with a value or several in each row.
        by_episode: Of those with a value or several for each episode.
        left: What is neither, and why.
        gaps: Those by row or by episode of which chunks are not there.
    """

    by_row: dict[str, tuple[Column, Path]] = field(default_factory=dict)
    by_episode: dict[str, tuple[Column, Path]] = field(default_factory=dict)
    left: dict[str, str] = field(default_factory=dict)
    gaps: list[str] = field(default_factory=list)

    def notes(self) -> list[str]:
        """What is left out, a sentence each."""
        why: dict[str, list[str]] = {}
        for name, reason in self.left.items():
            why.setdefault(reason, []).append(name)
        notes = [f"Not read: {', '.join(names)} ({reason})." for reason, names in why.items()]
        if self.gaps:
            notes.append(f"Chunks are not there, read as the fill value: {', '.join(self.gaps)}.")
        return notes


def described(arrays: Mapping[str, Path], *, rows: int, episodes: int) -> Described:
    """What arrays are, from their descriptions alone.

    Args:
        arrays: Folders by name.
        rows: Rows of all episodes.
        episodes: How many there are.
    """
    found = Described()
    for name, folder in arrays.items():
        try:
            column = column_of(name, folder)
        except BadInputError:
            column = None
        if column is None:
            found.left[name] = NO_NUMBERS
            continue
        length = int(head_of(folder)["shape"][0])
        if length in (rows, episodes) and has_gaps(folder):
            found.gaps.append(name)
        if length == rows:
            found.by_row[name] = column, folder
        elif length == episodes and (column.width or 1) <= WIDEST:
            found.by_episode[name] = column, folder
        else:
            found.left[name] = OTHER_LENGTH
    return found


class Beside:
    """Reads them, episode by episode."""

    def __init__(
        self, found: Described, ends: Sequence[int], *, read: Collection[str], also: Also
    ) -> None:
        """Nothing is decoded but what holds for an episode.

        Args:
            found: What there is.
            ends: Row behind each episode.
            read: What the contract reads.
            also: Says which others to read.
        """
        self.left: dict[str, str] = {}
        self._readers: dict[str, Iterator[NDArray[Any]]] = {}
        self._values: dict[str, NDArray[Any]] = {}
        longest = int(np.max(np.diff(np.asarray(ends), prepend=0)))
        budget = Budget()
        sizes: dict[str, tuple[int, Path]] = {}
        for name, (column, folder) in sorted(found.by_row.items()):
            if name in read or not also(column):
                continue
            try:
                # An episode of it and the block that is decoded are in memory at once.
                sizes[name] = bytes_of(column, longest) + largest_block(folder), folder
            except BadInputError:
                self.left[name] = NOT_READABLE
        for name, (column, folder) in sorted(found.by_episode.items()):
            if name not in read and also(Column(name, None)):
                sizes[name] = bytes_of(column, len(ends)), folder
        for name, (size, folder) in sorted(sizes.items(), key=lambda item: (item[1][0], item[0])):
            if not budget.takes(size):
                self.left[name] = TOO_LARGE
            elif name in found.by_row:
                self._readers[name] = slices(folder, ends)
            else:
                self._read(name, folder)

    def _read(self, name: str, folder: Path) -> None:
        try:
            self._values[name] = read_array(folder, filled=True)
        except BadInputError:
            self.left[name] = NOT_READABLE

    def next(self) -> dict[str, NDArray[Any]]:
        """Values by row of the next episode."""
        columns: dict[str, NDArray[Any]] = {}
        for name, reader in list(self._readers.items()):
            try:
                columns[name] = next(reader)
            except BadInputError:
                self.left[name] = NOT_READABLE
                del self._readers[name]
        return columns

    def of_episode(self, number: int) -> dict[str, str]:
        """Values that hold for one episode, as texts that `leaves` takes apart."""
        said = {name: text_of(values[number]) for name, values in self._values.items()}
        return {name: text for name, text in said.items() if text is not None}


def lists_of(root: Path, episodes: int) -> dict[str, list[str]]:
    """Attributes of the groups that are lists of a value for each episode, as texts.

    Args:
        root: The buffer.
        episodes: How many there are.
    """
    found: dict[str, list[str]] = {}
    for place in PLACES:
        try:
            document = document_of(root / place)
        except BadInputError:
            continue  # nothing depends on it
        for name, value in document.items():
            if isinstance(value, list) and len(value) == episodes > 1:
                found.setdefault(str(name), [text_of(item) or "" for item in value])
    return found
