"""Plain Parquet: a long table with a column of episodes, or one file per episode, or a folder."""

import contextlib
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.columns import labels_of
from genpolicy.data.formats.contract import ImportContract
from genpolicy.data.formats.detect import files_of
from genpolicy.data.formats.episode_column import episode_column, restarted
from genpolicy.data.formats.reading import Reading, reading
from genpolicy.data.formats.segments import episode_label, episodes_of, find_segments, longest
from genpolicy.data.formats.sidecars import among, of_file, of_folder
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

UUID_COLUMN = "uuid"


class ParquetFiles:
    """Parquet files as a source; see `genpolicy.data.formats.source.Source`."""

    rate_hz: float | None = None
    known: ImportContract | None = None

    def __init__(self, path: Path) -> None:
        """Describe the first readable file; its columns are those of all.

        Raises:
            BadInputError: No readable Parquet file.
        """
        self.name = path.name
        self._root = path if path.is_dir() else path.parent
        self._files = files_of(path, "parquet")
        if not self._files:
            refuse(str(path), "without a .parquet file", "a file, or a folder of them")
        self._table = self._first()
        self.columns: tuple[Column, ...] = tuple(self._table.columns.values())
        named = labels_of(self.columns)
        found = episode_column(self._tables, self._table.columns, named)
        self.labels = named.model_copy(update={"episode": found.name})
        self._restart = found.restart
        skipped = ", ".join(self._table.skipped)
        unread = (f"Not read: {skipped} (neither numbers nor text).",) if skipped else ()
        self.notes = (*unread, *found.notes, *self._sidecars(path))
        several = self.labels.episode is not None or self._restart is not None
        self.count = None if several else len(self._files)

    def episodes(
        self, wanted: Sequence[str], episode: str | None = None, also: Also = nothing
    ) -> Iterator[RawEpisode | Refusal]:
        """Each episode of each file, files by name; an unreadable file is one refusal."""
        done = 0
        for path in self._files:
            label = path.relative_to(self._root).as_posix()
            try:
                with open_table(path, label=label) as table:
                    done += yield from self._of(table, wanted, episode, also, done)
            except BadInputError as error:
                yield refusal_of(label, error)

    def _tables(self) -> Iterator[Table]:
        """Every readable file, described."""
        for path in self._files:
            label = path.relative_to(self._root).as_posix()
            with (
                contextlib.suppress(BadInputError),
                open_table(path, label=label, hashed=False) as table,
            ):
                yield table

    def _sidecars(self, path: Path) -> tuple[str, ...]:
        if not path.is_dir():
            return of_file(path)
        return of_folder(path, among({f.relative_to(path).as_posix() for f in self._files}))

    def _first(self) -> Table:
        """The file that describes all, whatever the files are called.

        One of the commonest kind, of equally common ones that with fewer columns. What only few
        files have cannot be observed or commanded in all.
        """
        names = {path: _names(path) for path in self._files}
        kinds = Counter(names.values())
        having = Counter(name for found in names.values() for name in found)
        rank = {kind: (not kind, -kinds[kind], len(kind), kind) for kind in kinds}
        ranked = sorted(self._files, key=lambda path: rank[names[path]])
        table = described([(path, path.relative_to(self._root).as_posix()) for path in ranked])
        many = {n: c for n, c in table.columns.items() if 2 * having[n] > len(names)}
        return replace(table, columns=many or table.columns)

    def _of(
        self, table: Table, wanted: Sequence[str], episode: str | None, also: Also, done: int
    ) -> Generator[RawEpisode | Refusal, None, int]:
        # Where rows begin anew was looked at under the column that the names proposed.
        restart = self._restart if episode == self.labels.episode else None
        if episode is None and restart is None:
            if table.rows > MAXIMUM_EPISODE_ROWS:
                refuse(table.label, f"{table.rows} rows long", f"at most {MAXIMUM_EPISODE_ROWS}")
            read = reading(table, wanted, also, rows=table.rows)
            columns = read_columns(table, read.names, read.beside, read.left)
            check_columns(columns, label=table.label, known=self._known(table, read))
            yield RawEpisode(table.label, table.digest, columns, first_row=done, left=read.left)
            return table.rows
        segments = (
            find_segments(table, episode or "")
            if restart is None
            else restarted(table, episode, restart)
        )
        read = reading(table, wanted, also, rows=longest(segments))
        known = self._known(table, read)
        for segment, found in episodes_of(table, segments, read.names, read.beside, read.left):
            if isinstance(found, Refusal):
                yield found
                continue
            label = episode_label(table.label, segment.key)
            try:
                check_columns(found, label=label, known=known)
            except BadInputError as error:
                yield refusal_of(label, error)
                continue
            uuid = restart is None and UUID_COLUMN in (episode or "").lower()
            yield RawEpisode(
                label=label,
                digest=table.digest,
                columns=found,
                attributes={"episode_uuid": segment.key} if uuid else {},
                first_row=done + segment.start,
                left=read.left,
            )
        return table.rows

    def _known(self, table: Table, read: Reading) -> dict[str, Column]:
        """What each column should be; what is read beside may differ from file to file."""
        return table.columns | {c.name: c for c in self.columns if c.name not in read.beside}


def _names(path: Path) -> tuple[str, ...]:
    """Names of the columns; none where it is no readable table."""
    try:
        return tuple(pq.read_schema(path).names)
    except (pa.ArrowException, OSError, ValueError):
        return ()


def open_source(path: Path) -> ParquetFiles:
    """Parquet files, described; see `ParquetFiles`."""
    return ParquetFiles(path)
