"""LeRobot datasets, v2.0, v2.1 and v3.0: joint states and actions; video is left out.

The data decide. Where counts or lengths of the metadata disagree with them it is a note; where
the indices inside the data contradict each other, the episode is refused.
"""

from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.columns import labels_of
from genpolicy.data.formats.contract import ImportContract
from genpolicy.data.formats.leaves import holds_several
from genpolicy.data.formats.lerobot_meta import (
    data_files,
    is_of_layout,
    read_episodes,
    read_info,
    read_tasks,
)
from genpolicy.data.formats.reading import Reading, reading
from genpolicy.data.formats.segments import episodes_of, find_segments, longest
from genpolicy.data.formats.sidecars import of_folder
from genpolicy.data.formats.source import (
    MAXIMUM_EPISODE_ROWS,
    Also,
    Column,
    RawEpisode,
    check_columns,
    nothing,
    refusal_of,
    refuse,
)
from genpolicy.data.formats.tables import Table, described, open_table, read_columns
from genpolicy.errors import BadInputError

EPISODE, FRAME, INDEX, TASK = "episode_index", "frame_index", "index", "task_index"
TIME, SUCCESS = "timestamp", "next.success"
SWITCHING_TASK = "instruction"
OWN = ("episode_index", "length", "stats")
TASKS = "tasks"
Asked = tuple[Sequence[str], Also]


class LeRobotDataset:
    """A LeRobot dataset as a source; see `genpolicy.data.formats.source.Source`."""

    known: ImportContract | None = None

    def __init__(self, path: Path) -> None:
        """Read the description and list the data files.

        Raises:
            BadInputError: The description is not one of LeRobot's, or there are no data files.
        """
        self.name = path.name
        self._root = path
        self._info = read_info(path)
        self.rate_hz: float | None = self._info.rate_hz
        self._files = data_files(path, self._info)
        self._by_file = self._info.version.startswith("v2")
        self._tasks = read_tasks(path, self._info)
        self._listed, notes = read_episodes(path, self._info)
        self._drop_tasks()
        if not self._files:
            refuse(str(path), "without a data file", "files named by its template")
        first = self._files[0][1]
        table = described([(first, self._label(first))])
        stored = dict(table.columns)
        strange = [name for name in table.skipped if name not in self._info.skipped]
        if strange:
            notes.append(f"Not read: {', '.join(strange)} (neither numbers nor text).")
        self.columns = self._columns(stored, notes)
        self.labels = labels_of(
            self.columns,
            episode=None,
            frame=FRAME if FRAME in stored else None,
            time=TIME if TIME in stored else None,
            task="task" if self._tasks else None,
        )
        self.count = len(self._files) if self._by_file else (self._info.episodes or None)
        data = {self._label(file) for _, file in self._files}
        sidecars = of_folder(path, lambda name: name in data or is_of_layout(name))
        self.notes = (*notes, *self._disagreements(), *sidecars)

    def episodes(
        self, wanted: Sequence[str], episode: str | None = None, also: Also = nothing
    ) -> Iterator[RawEpisode | Refusal]:
        """Each episode in the order of the data files; listed ones without data are refused."""
        done = 0
        seen: set[int] = set()
        for number, path in self._files:
            label = self._label(path)
            try:
                with open_table(path, label=label) as table:
                    reader = self._one if self._by_file else self._many
                    done += yield from reader(table, number, (wanted, also), done, seen)
            except BadInputError as error:
                yield refusal_of(label, error)
                seen.add(number)
        for number in sorted(set(self._listed) - seen):
            label = f"episode_{number:06d}"
            yield Refusal(label, label, f"{label} is listed in the metadata and has no data.")

    def _one(
        self, table: Table, number: int, asked: Asked, done: int, seen: set[int]
    ) -> Generator[RawEpisode | Refusal, None, int]:
        """A file of one episode."""
        seen.add(number)
        if table.rows > MAXIMUM_EPISODE_ROWS:
            refuse(table.label, f"{table.rows} rows long", f"at most {MAXIMUM_EPISODE_ROWS}")
        read = reading(table, self._needed(table, asked[0]), asked[1], rows=table.rows)
        columns = read_columns(table, read.names, read.beside, read.left)
        yield self._raw((table, read), number, columns, table.label, done)
        return table.rows

    def _many(
        self, table: Table, number: int, asked: Asked, done: int, seen: set[int]
    ) -> Generator[RawEpisode | Refusal, None, int]:
        """A file of several episodes, one after the other."""
        segments = find_segments(table, EPISODE)
        read = reading(table, self._needed(table, asked[0]), asked[1], rows=longest(segments))
        for segment, columns in episodes_of(table, segments, read.names, read.beside, read.left):
            if isinstance(columns, Refusal):
                yield columns
                seen |= {int(segment.key)} if segment.key.isdigit() else set()
                continue
            label = f"{table.label}#episode_{segment.key:0>6}"
            try:
                if not segment.key.isdigit() or int(segment.key) in seen:
                    refuse(f"{label}: {EPISODE}", segment.key, "a number that no file before had")
                seen.add(int(segment.key))
                found = (table, read), int(segment.key), columns, label
                yield self._raw(*found, done + segment.start)
            except BadInputError as error:
                yield refusal_of(label, error)
        return table.rows

    def _raw(
        self,
        source: tuple[Table, Reading],
        number: int,
        columns: dict[str, NDArray[Any]],
        label: str,
        first_row: int,
    ) -> RawEpisode:
        table, read = source
        declared = {
            c.name: c
            for c in self.columns
            if not c.per_episode and c.width is not None and c.name not in read.beside
        }
        check_columns(columns, label=label, known=table.columns | declared)
        _check_indices(columns, number, label)
        attributes = {
            key: value for key, value in self._listed.get(number, {}).items() if key not in OWN
        }
        if TASK in columns and self._tasks and len(columns[TASK]):
            texts = self._texts(columns[TASK], f"{label}: {TASK}")
            switches = bool((texts != texts[0]).any())
            attributes["task"] = "not_recorded" if switches else texts[0]
            if switches:
                # Another instruction on the way: a value by row, and none for the episode.
                columns = {**columns, SWITCHING_TASK: texts}
        if SUCCESS in columns:
            # It becomes true in the row that reaches the goal, and only there.
            attributes["success"] = str(bool(np.any(columns[SUCCESS]))).lower()
        return RawEpisode(label, table.digest, columns, attributes, first_row, read.left)

    def _texts(self, numbers: NDArray[Any], where: str) -> NDArray[Any]:
        """The instruction of each row; a change to one that nobody described is damage (n,)."""
        known, place = np.unique(numbers, return_inverse=True)
        if any(int(number) not in self._tasks for number in known):
            _check_one(numbers, where)
        texts = [self._tasks.get(int(number), "not_recorded") for number in known]
        return np.array(texts, dtype=object)[place.reshape(-1)]

    def _drop_tasks(self) -> None:
        """Several texts of an episode are kept; its one instruction is what its rows say."""
        texts = [said[TASKS] for said in self._listed.values() if TASKS in said]
        if self._tasks and not any(holds_several(text) for text in texts):
            for said in self._listed.values():
                said.pop(TASKS, None)

    def _needed(self, table: Table, wanted: Sequence[str]) -> list[str]:
        """Columns to read in any case: those wanted and the indices, which are always checked."""
        per_episode = {column.name for column in self.columns if column.per_episode}
        names = [name for name in wanted if name not in per_episode or name in table.columns]
        return names + [n for n in (EPISODE, FRAME, INDEX, TASK, SUCCESS) if n in table.columns]

    def _columns(self, stored: dict[str, Column], notes: list[str]) -> tuple[Column, ...]:
        """What is stored, with the names that the description gives; what it lacks is a note."""
        described = {column.name: column for column in self._info.features}
        columns: list[Column] = []
        for name, column in stored.items():
            feature = described.get(name)
            if feature is None:
                notes.append(f"{name} is stored and not described.")
            elif feature.width not in (column.width, 1 if column.width is None else column.width):
                notes.append(f"{name} is described {feature.width} wide, stored {column.width}.")
            names = feature.components if feature is not None else ()
            columns.append(replace(column, components=names))
        missing = [name for name in described if name not in stored]
        if missing:
            notes.append(f"Described and not stored: {', '.join(missing)}.")
        if self._info.skipped:
            notes.append(f"Not read: {', '.join(self._info.skipped)} (video or pictures).")
        keys = {key for values in self._listed.values() for key in values} - set(OWN)
        keys |= {"task"} if self._tasks else set()
        keys |= {"success"} if SUCCESS in stored else set()
        extra = [Column(key, None, "text", per_episode=True) for key in sorted(keys - set(stored))]
        return (*columns, *extra)

    def _disagreements(self) -> list[str]:
        """Where the counts of the metadata contradict each other or the files."""
        notes: list[str] = []
        info, listed = self._info, self._listed
        if info.episodes is not None and listed and info.episodes != len(listed):
            notes.append(
                f"meta/info.json counts {info.episodes} episodes, the list has {len(listed)}; "
                "the data decide."
            )
        if self._by_file and info.episodes is not None and info.episodes != len(self._files):
            notes.append(
                f"meta/info.json counts {info.episodes} episodes, there are {len(self._files)} "
                "files; the data decide."
            )
        lengths = [
            value["length"] for value in listed.values() if value.get("length", "").isdigit()
        ]
        total = sum(int(length) for length in lengths)
        if info.frames is not None and len(lengths) == len(listed) > 0 and total != info.frames:
            notes.append(
                f"meta/info.json counts {info.frames} frames, the list {total}; the data decide."
            )
        return notes

    def _label(self, path: Path) -> str:
        return path.relative_to(self._root).as_posix()


def open_source(path: Path) -> LeRobotDataset:
    """A LeRobot dataset, described; see `LeRobotDataset`."""
    return LeRobotDataset(path)


def _check_indices(columns: dict[str, NDArray[Any]], number: int, label: str) -> None:
    """The three indices that LeRobot writes into every row must agree with each other."""
    if EPISODE in columns:
        wrong = np.flatnonzero(columns[EPISODE] != number)
        if len(wrong):
            found = str(columns[EPISODE][wrong[0]])
            refuse(f"{label}: {EPISODE}, row {wrong[0]}", found, str(number))
    if FRAME in columns:
        expected = np.arange(len(columns[FRAME]))
        wrong = np.flatnonzero(columns[FRAME] != expected)
        if len(wrong):
            found = str(columns[FRAME][wrong[0]])
            refuse(f"{label}: {FRAME}, row {wrong[0]}", found, f"{wrong[0]} (a gap)")
    if INDEX in columns:
        wrong = np.flatnonzero(np.diff(columns[INDEX].astype(np.int64)) != 1)
        if len(wrong):
            row = int(wrong[0]) + 1
            found = f"{columns[INDEX][row]} after {columns[INDEX][row - 1]}"
            refuse(f"{label}: {INDEX}, row {row}", found, "one more than the row before")


def _check_one(values: NDArray[Any], where: str) -> None:
    wrong = np.flatnonzero(values != values[0])
    if len(wrong):
        refuse(f"{where}, row {wrong[0]}", f"{values[wrong[0]]}", f"{values[0]}, as before")
