"""robomimic HDF5: `data/demo_*` with `actions` and `obs/*`, attributes and masks.

HDF5 can read other files: external links, external storage and virtual data sets reach out of
the file, and a filter can load a library. All of them are refused before anything is read.
"""

import json
import os
import re
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
from numpy.typing import NDArray

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.columns import labels_of
from genpolicy.data.formats.contract import ImportContract
from genpolicy.data.formats.detect import only_hdf5
from genpolicy.data.formats.hdf5_single import (
    READ_ERRORS,
    REWRITE,
    attributes_of,
    check_storage,
    member,
    read_single,
)
from genpolicy.data.formats.leaves import MAXIMUM_TEXT, leaves
from genpolicy.data.formats.masks import read_masks, say
from genpolicy.data.formats.sidecars import among, of_file, of_folder
from genpolicy.data.formats.source import (
    MAXIMUM_EPISODE_ROWS,
    MAXIMUM_VALUE_BYTES,
    Also,
    Column,
    RawEpisode,
    check_columns,
    nothing,
    refusal_of,
    refuse,
)
from genpolicy.errors import BadInputError, IntegrityError

DATA, OBSERVATIONS, MASK = "data", "obs", "mask"
ACTIONS = "actions"
PER_ROW = ("actions", "rewards", "dones")
MAXIMUM_ATTRIBUTE = 1 << 20
HASH_BYTES = 1 << 20


class RobomimicFile:
    """A robomimic file as a source; see `genpolicy.data.formats.source.Source`."""

    known: ImportContract | None = None

    def __init__(self, path: Path, sidecars: Sequence[str] = ()) -> None:
        """Describe the first readable demonstration and list all.

        Args:
            path: The file.
            sidecars: The notes on files beside it.

        Raises:
            BadInputError: Not HDF5, without demonstrations, or with links to other places.
        """
        self.name = path.name
        self._path = path
        notes: list[str] = []
        self._state = _state(path)
        with _open(path, hashed=False) as (file, _):
            data = _group(file, DATA, self.name)
            self._demos = sorted((name for name in data if name != MASK), key=_natural)
            if not self._demos:
                refuse(f"{self.name}: {DATA}", "empty", "demonstrations demo_0, demo_1, …")
            self.rate_hz, self._delta = _environment(data, notes)
            self._operators, self._masks = _masks(file, self.name, self._demos, notes)
            columns, attributes, skipped = self._describe(data)
        if skipped:
            notes.append(f"Not read: {', '.join(skipped)} (pictures, or no plain numbers).")
        if self._delta:
            notes.append("The controller takes differences: the action is no position.")
        if self._operators:
            notes.append("The operator was taken from the file's masks.")
            attributes.add("operator")
        attributes |= {mask for said in self._masks.values() for mask in said}
        extra = [Column(n, None, "text", per_episode=True) for n in sorted(attributes)]
        self.columns: tuple[Column, ...] = (*columns, *extra)
        self.labels = labels_of(self.columns, episode=None, frame=None)
        self.notes = (*notes, *sidecars)
        self.count = len(self._demos)

    def episodes(
        self, wanted: Sequence[str], episode: str | None = None, also: Also = nothing
    ) -> Iterator[RawEpisode | Refusal]:
        """Each demonstration by number."""
        per_episode = {column.name for column in self.columns if column.per_episode}
        names = list(dict.fromkeys([*(n for n in wanted if n not in per_episode), ACTIONS]))
        done = 0
        with _open(self._path) as (file, digest):
            if _state(self._path) != self._state:
                refuse(self.name, "changed while it was read", "the bytes of before")
            data = _group(file, DATA, self.name)
            for demo in self._demos:
                label = f"{self.name}#{demo}"
                try:
                    raw = self._read(data, demo, names, label, (digest, done))
                    group = _group(data, demo, label)
                    beside = read_single(group, raw.columns, also)
                    raw = replace(
                        raw,
                        columns=raw.columns | beside.by_row,
                        attributes=raw.attributes | beside.single,
                        left=attributes_of(group)[1] | beside.left,
                    )
                    done += len(raw.columns[ACTIONS])
                    yield raw
                except BadInputError as error:
                    yield refusal_of(label, error)
                except READ_ERRORS as error:
                    yield refusal_of(label, _unreadable(label, error))

    def _read(
        self, data: Any, demo: str, names: Sequence[str], label: str, origin: tuple[str, int]
    ) -> RawEpisode:
        digest, done = origin
        group = _group(data, demo, label)
        columns = {name: _values(group, name, label) for name in names}
        check_columns(columns, label=label, known={c.name: c for c in self.columns})
        attributes = _attributes(group)
        attributes |= self._masks.get(demo, {})
        if demo in self._operators:
            attributes["operator"] = self._operators[demo]
        return RawEpisode(label, digest, columns, attributes, first_row=done)

    def _describe(self, data: Any) -> tuple[list[Column], set[str], list[str]]:
        """Columns of the first demonstration that can be described."""
        first: BadInputError | None = None
        for demo in self._demos:
            try:
                return _columns(_group(data, demo, demo), f"{self.name}#{demo}")
            except BadInputError as error:
                first = first or error
        raise first or AssertionError("no demonstration was tried")


def open_source(path: Path) -> RobomimicFile:
    """A robomimic file, or the only one of a folder, described; see `RobomimicFile`."""
    file = only_hdf5(path)
    if not path.is_dir() or file == path:
        return RobomimicFile(file, of_file(file))
    return RobomimicFile(file, of_folder(path, among({file.relative_to(path).as_posix()})))


@contextmanager
def _open(path: Path, *, hashed: bool = True) -> Iterator[tuple[Any, str]]:
    """The file and the SHA-256 of the very bytes that are read; opened without following a link.

    It must open as HDF5 before it is hashed: that costs nothing, and a hash of 300 GB minutes.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise _unreadable(path.name, error) from error
    with os.fdopen(descriptor, "rb") as stream:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            refuse(path.name, "a folder or a device", "a regular file", REWRITE)
        if hashed:
            _file(stream, path.name).close()
        digest = _digest(stream) if hashed else ""
        with _file(stream, path.name) as file:
            try:
                yield file, digest
            except READ_ERRORS as error:  # what a damaged file makes the library raise
                raise _unreadable(path.name, error) from error


def _file(stream: BinaryIO, name: str) -> Any:
    try:
        return h5py.File(stream, "r")
    except READ_ERRORS as error:
        raise _unreadable(name, error) from error


def _digest(stream: BinaryIO) -> str:
    stream.seek(0)
    digest = sha256()
    while block := stream.read(HASH_BYTES):
        digest.update(block)
    stream.seek(0)
    return digest.hexdigest()


def _state(path: Path) -> tuple[int, int, int]:
    """What changes with the file: number, size and time of change."""
    status = path.lstat()
    return status.st_ino, status.st_size, status.st_mtime_ns


def _group(parent: Any, name: str, where: str) -> Any:
    found = member(parent, name, where)
    if not isinstance(found, h5py.Group):
        refuse(f"{where}: {name}", "no group", "a group")
    return found


def _values(group: Any, name: str, where: str) -> NDArray[Any]:
    """A data set, whole, after everything that reaches out of the file has been refused."""
    data = member(group, name, where)
    place = f"{where}: {name}"
    if not isinstance(data, h5py.Dataset):
        refuse(place, "no data set", "a data set")
    check_storage(data, place)
    if data.ndim not in (1, 2) or data.dtype.kind not in "fiub":
        refuse(place, f"of shape {data.shape} and type {data.dtype}", "numbers by row")
    if (
        data.shape[0] > MAXIMUM_EPISODE_ROWS
        or data.size * data.dtype.itemsize > MAXIMUM_VALUE_BYTES
    ):
        refuse(place, f"of shape {data.shape}", f"at most {MAXIMUM_EPISODE_ROWS} rows")
    return np.asarray(data[...])


def _columns(demo: Any, where: str) -> tuple[list[Column], set[str], list[str]]:
    # Listed, not asked for: `in` would follow a link out of the file.
    present = set(demo)
    names = [name for name in PER_ROW if name in present]
    observations = _group(demo, OBSERVATIONS, where)
    names += [f"{OBSERVATIONS}/{name}" for name in sorted(observations)]
    columns: list[Column] = []
    skipped: list[str] = []
    for name in names:
        data = member(demo, name, where)
        plain = isinstance(data, h5py.Dataset) and data.ndim in (1, 2) and data.dtype.kind in "fiub"
        if not plain:
            skipped.append(name)
            continue
        check_storage(data, f"{where}: {name}")
        columns.append(Column(name, int(data.shape[1]) if data.ndim == 2 else None))
    if ACTIONS not in [column.name for column in columns]:
        refuse(f"{where}: {ACTIONS}", "missing", "the actions of the demonstration")
    return columns, set(_attributes(demo)), skipped


def _attributes(group: Any) -> dict[str, str]:
    """Attributes as text; of a long one its parts, and no model of a simulator."""
    result: dict[str, str] = {}
    for name, text in attributes_of(group)[0].items():
        result |= {name: text} if len(text) <= MAXIMUM_TEXT else leaves(name, text)
    return result


def _masks(
    file: Any, where: str, demos: Sequence[str], notes: list[str]
) -> tuple[dict[str, str], dict[str, dict[str, str]]]:
    """Operator, and what else the masks of the file say, by demonstration."""
    if MASK not in set(file):
        return {}, {}
    members = read_masks(_group(file, MASK, where), f"{where}: {MASK}", notes)
    return say(members, demos, notes)


def _environment(data: Any, notes: list[str]) -> tuple[float | None, bool]:
    """Control rate and whether the controller takes differences, from `env_args`."""
    text = data.attrs.get("env_args", "")
    if not isinstance(text, str) or not 0 < len(text) <= MAXIMUM_ATTRIBUTE:
        return None, False
    try:
        arguments = json.loads(text)["env_kwargs"]
        rate = arguments.get("control_freq")
        delta = '"control_delta": true' in json.dumps(arguments.get("controller_configs"))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        notes.append("The attribute env_args could not be read.")
        return None, False
    valid = isinstance(rate, int | float) and not isinstance(rate, bool) and 0 < rate <= 100_000
    return (float(rate) if valid else None), delta


def _natural(name: str) -> tuple[int, str]:
    digits = re.sub(r"\D", "", name)
    return (int(digits[-12:]) if digits else -1, name)


def _unreadable(where: str, error: Exception) -> IntegrityError:
    return IntegrityError(
        where=where,
        found=f"not readable ({' '.join(str(error).split())[:160]})",
        expected="a whole HDF5 file",
        action="Fetch or write the file again.",
    )
