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
from genpolicy.data.formats.source import (
    Also,
    Column,
    RawEpisode,
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
        single: set[str] = set()
        skipped: list[str] = []
        for name, folder in first.items():
            shape = head_of(folder)["shape"]
            column = column_of(name, folder)
            if column is None and shape != []:
                skipped.append(name)
            elif column is None or (column.width is None and shape[0] == 1 != rows):
                single.add(name)
            else:
                columns.append(column)
        if not columns:
            refuse(str(self._groups[0]), "without arrays of rows", "the arrays of an episode")
        self._single = single
        names = sorted(single | set(attributes_of(self._groups[0])))
        extra = [Column(name, None, "text", per_episode=True) for name in names]
        self.columns = (*columns, *extra)
        self.labels = labels_of(self.columns, episode=None, frame=None)
        self.notes = (f"Not read: {', '.join(skipped)} (no plain columns).",) if skipped else ()
        self.count = len(self._groups)
        self.digest = sha256_bytes(canonical_json(sha256_tree(path)))

    def episodes(
        self, wanted: Sequence[str], episode: str | None = None, also: Also = nothing
    ) -> Iterator[RawEpisode | Refusal]:
        """Each group with the wanted arrays, or why it could not be read."""
        known = {column.name: column for column in self.columns}
        more = [
            column.name
            for column in self.columns
            if not column.per_episode and column.width is None and also(column)
        ]
        names = [name for name in dict.fromkeys([*wanted, *more]) if not known[name].per_episode]
        done = 0
        for group in self._groups:
            label = f"{self.name}#{group.relative_to(self.path).as_posix()}"
            try:
                columns = {name: _read(group, name, label) for name in names}
                check_columns(columns, label=label, known=known)
                attributes = attributes_of(group) | {
                    name: str(_read(group, name, label).reshape(-1)[0])
                    for name in sorted(self._single)
                    if name in arrays_below(group)
                }
            except BadInputError as error:
                yield refusal_of(label, error)
                continue
            yield RawEpisode(label, self.digest, columns, attributes, first_row=done)
            done += len(next(iter(columns.values())))


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
