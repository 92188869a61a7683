"""A zarr file with a group per episode to a dataset.

`episode_0/obs/state`, `episode_0/action`, `episode_1/…`: each group holds the arrays of one
episode, at the root or below `data`. Arrays of one value, and what a group says beside its arrays,
hold for the whole episode.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.columns import labels_of
from genpolicy.data.formats.contract import ImportContract
from genpolicy.data.formats.leaves import WIDEST, text_of
from genpolicy.data.formats.source import (
    NOT_READABLE,
    TOO_LARGE,
    Also,
    Budget,
    Column,
    RawEpisode,
    bytes_of,
    check_columns,
    nothing,
    refusal_of,
)
from genpolicy.data.formats.zarr_arrays import (
    arrays_below,
    attributes_of,
    column_of,
    head_of,
    is_group,
    read_array,
    refuse,
)
from genpolicy.data.formats.zarr_beside import OTHER_LENGTH
from genpolicy.errors import BadInputError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_tree

PLACES = ("data", "episodes", "")
# A group that is no episode of a buffer, whatever lies in it.
NO_EPISODE = {"meta", "info", "data", "obs", "observation", "observations"}


class EpisodeGroups:
    """The groups as a source; see `genpolicy.data.formats.source.Source`."""

    rate_hz: float | None = None
    known: ImportContract | None = None

    def __init__(self, path: Path, groups: Sequence[Path]) -> None:
        """Describe the arrays of the first group; decodes nothing.

        Raises:
            BadInputError: An array that is not plain numbers, or none at all.
        """
        self.path = path
        self.name = path.name
        self._groups = list(groups)
        first = arrays_below(self._groups[0])
        rows = _usual_rows(first)
        columns: list[Column] = []
        self._single: set[str] = set()
        skipped: list[str] = []
        for name, folder in first.items():
            shape = head_of(folder)["shape"]
            column = column_of(name, folder)
            few = len(shape) <= 1 and (shape or [1])[0] <= WIDEST
            if few and shape != [rows]:
                self._single.add(name)
            elif column is None or shape[0] != rows:
                skipped.append(name)
            else:
                columns.append(column)
        if not columns:
            refuse(str(self._groups[0]), "without arrays of rows", "the arrays of an episode")
        names = sorted(self._single | set(_said_by(self._groups[0])))
        extra = [Column(name, None, "text", per_episode=True) for name in names]
        self.columns = (*columns, *extra)
        self.labels = labels_of(self.columns, episode=None, frame=None)
        self.notes = (
            (f"Not read: {', '.join(skipped)} (no columns of its rows).",) if skipped else ()
        )
        self.count = len(self._groups)
        self.digest = sha256_bytes(canonical_json(sha256_tree(path)))

    def episodes(
        self, wanted: Sequence[str], episode: str | None = None, also: Also = nothing
    ) -> Iterator[RawEpisode | Refusal]:
        """Each group with the wanted arrays, or why it could not be read."""
        known = {column.name: column for column in self.columns}
        names = [name for name in dict.fromkeys(wanted) if not known[name].per_episode]
        more = [c for c in self.columns if not c.per_episode and c.name not in names and also(c)]
        done = 0
        for group in self._groups:
            label = f"{self.name}#{group.relative_to(self.path).as_posix()}"
            try:
                columns = {name: _read(group, name, label) for name in names}
                check_columns(columns, label=label, known=known)
            except BadInputError as error:
                yield refusal_of(label, error)
                continue
            rows = len(next(iter(columns.values())))
            beside, left = _beside(group, more, rows, label)
            single, missing = self._of(group, label)
            yield RawEpisode(
                label,
                self.digest,
                columns | beside,
                _said_by(group) | single,
                first_row=done,
                left=left | missing,
            )
            done += rows

    def _of(self, group: Path, label: str) -> tuple[dict[str, str], dict[str, str]]:
        """Arrays of one value or a few that hold for the episode, and those not readable."""
        found: dict[str, str] = {}
        left: dict[str, str] = {}
        there = arrays_below(group)
        for name in sorted(self._single & set(there)):
            try:
                values = _read(group, name, label).reshape(-1)
                text = text_of(values[0] if len(values) == 1 else values[:WIDEST])
            except BadInputError:
                text = None
            if text is None:
                left[name] = NOT_READABLE
            else:
                found[name] = text
        return found, left


def _beside(
    group: Path, more: Sequence[Column], rows: int, label: str
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Columns that nothing depends on, and those that are left out and why."""
    found: dict[str, NDArray[Any]] = {}
    left: dict[str, str] = {}
    budget = Budget()
    for column in sorted(more, key=lambda column: (column.width or 1, column.name)):
        if not budget.takes(bytes_of(column, rows)):
            left[column.name] = TOO_LARGE
            continue
        try:
            values = _read(group, column.name, label)
        except BadInputError:
            left[column.name] = NOT_READABLE
            continue
        if values.shape == ((rows,) if column.width is None else (rows, column.width)):
            found[column.name] = values
        else:
            left[column.name] = OTHER_LENGTH
    return found, left


def _said_by(group: Path) -> dict[str, str]:
    """Attributes of an episode's group and of the groups in it."""
    found = attributes_of(group)
    for folder in sorted(group.iterdir()):
        if folder.is_dir() and is_group(folder):
            said = attributes_of(folder)
            found |= {f"{folder.name}/{name}": text for name, text in said.items()}
    return found


def groups_of(path: Path) -> list[Path] | None:
    """The groups of the episodes in natural order; None where there are not several alike."""
    for place in PLACES:
        here = path / place
        if not here.is_dir():
            continue
        below = [
            folder
            for folder in here.iterdir()
            if folder.name not in NO_EPISODE and is_group(folder) and arrays_below(folder)
        ]
        # Episodes are counted; groups of sensors have names.
        counted = [folder for folder in below if any(map(str.isdecimal, folder.name))]
        if len(counted) > 1 and len(counted) == len(below):
            return sorted(counted, key=lambda folder: _natural(folder.name))
    return None


def _usual_rows(arrays: dict[str, Path]) -> int:
    """Rows of most arrays: what has another number of values is no column."""
    rows = [shape[0] for folder in arrays.values() if (shape := head_of(folder)["shape"])]
    return max(set(rows), key=rows.count, default=0)


def _read(group: Path, name: str, label: str) -> NDArray[Any]:
    if not (group / name).is_dir():
        refuse(f"{label}: {name}", "missing", "as in the other episodes")
    return read_array(group / name)


def _natural(text: str) -> list[tuple[int, int, str]]:
    parts = re.findall(r"\d+|\D+", text)
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts]
