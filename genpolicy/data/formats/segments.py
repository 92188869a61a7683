"""Episodes inside a long table: where each begins and ends, then one after the other.

The column of the episodes is read once, alone; then all wanted columns once, in order. Never is
more than one episode and one batch in memory.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.source import MAXIMUM_EPISODE_ROWS, refusal_of, refuse
from genpolicy.data.formats.tables import Table, batches
from genpolicy.errors import BadInputError

MAXIMUM_SEGMENTS = 2_000_000


@dataclass(frozen=True)
class Segment:
    """Rows of one episode that follow each other.

    Attributes:
        key: The episode's identifier, as text.
        start: First row.
        stop: Row after the last.
    """

    key: str
    start: int
    stop: int


def find_segments(table: Table, column: str) -> list[Segment]:
    """Runs of equal identifiers.

    Raises:
        BadInputError: The column is missing, holds nulls, or the table is not sorted by episode.
    """
    edges: list[int] = []
    keys: list[Any] = []
    done = 0
    for batch in batches(table, [column]):
        values = batch[column]
        if values.ndim != 1:
            refuse(f"{table.label}: {column}", "a vector", "one identifier per row")
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            row = done + int(np.argmin(np.isfinite(values)))
            refuse(f"{table.label}: {column}, row {row}", "null or not finite", "an identifier")
        starts = np.flatnonzero(values[1:] != values[:-1]) + 1
        if len(values) and (not keys or values[0] != keys[-1]):
            starts = np.concatenate([[0], starts])
        edges += (done + starts).tolist()
        keys += values[starts].tolist()
        done += len(values)
        if len(edges) > MAXIMUM_SEGMENTS:
            found = f"of more than {MAXIMUM_SEGMENTS} runs"
            refuse(f"{table.label}: {column}", found, "a table sorted by episode")
    stops = [*edges[1:], done]
    return [
        Segment(key_of(key), start, stop)
        for key, start, stop in zip(keys, edges, stops, strict=True)
    ]


def longest(segments: Sequence[Segment]) -> int:
    """Rows of the longest episode."""
    return max((segment.stop - segment.start for segment in segments), default=0)


def episodes_of(
    table: Table,
    segments: Sequence[Segment],
    wanted: Sequence[str],
    beside: Collection[str] = (),
    left: dict[str, str] | None = None,
) -> Iterator[tuple[Segment, dict[str, NDArray[Any]] | Refusal]]:
    """Each episode with its columns; one in two places, too long or unreadable is a refusal.

    Args:
        table: The file.
        segments: The episodes, in order.
        wanted: Names of columns.
        beside: Those of them that nothing depends on.
        left: Gets those of them that are damaged, and why.
    """
    places = Counter(segment.key for segment in segments)
    reader = batches(table, wanted, beside, left)
    rows = _Rows(reader)
    refused: set[str] = set()
    broken: Refusal | None = None
    for segment in segments:
        label = episode_label(table.label, segment.key)
        if segment.key in refused:
            _drop(rows, segment)
            continue
        try:
            if broken is not None:
                yield segment, Refusal(label, broken.where, broken.reason)
                continue
            if places[segment.key] > 1:
                refused.add(segment.key)
                starts = [s.start for s in segments if s.key == segment.key][:3]
                found = f"in {places[segment.key]} places, rows {starts}"
                refuse(label, found, "rows that follow each other")
            if segment.stop - segment.start > MAXIMUM_EPISODE_ROWS:
                found = f"{segment.stop - segment.start} rows long"
                refuse(label, found, f"at most {MAXIMUM_EPISODE_ROWS}")
        except BadInputError as error:
            yield segment, refusal_of(label, error)
            _drop(rows, segment)
            continue
        try:
            yield segment, rows.take(segment.start, segment.stop)
        except BadInputError as error:
            # What lies behind a damaged page cannot be read in order: it is refused too.
            broken = refusal_of(label, error)
            yield segment, broken


def episode_label(table: str, key: str) -> str:
    """What texts call an episode of a long table."""
    return f"{table}#episode_{int(key):06d}" if key.isdigit() else f"{table}#{key[:80]}"


class _Rows:
    """Rows of a table by number, read forward only."""

    def __init__(self, reader: Iterator[dict[str, NDArray[Any]]]) -> None:
        self._reader = reader
        self._held: list[dict[str, NDArray[Any]]] = []
        self._first = 0
        self._stop = 0

    def take(self, start: int, stop: int) -> dict[str, NDArray[Any]]:
        """Rows `start` to `stop`; earlier ones are dropped."""
        while self._stop < stop:
            batch = next(self._reader, None)
            if batch is None:
                refuse(f"rows {self._stop} to {stop}", "missing", "as many rows as announced")
            self._held.append(batch)
            self._stop += len(next(iter(batch.values())))
        # One part is not copied: thousands of short episodes may lie in one batch.
        joined = self._held[0] if len(self._held) == 1 else _joined(self._held)
        taken = {name: v[start - self._first : stop - self._first] for name, v in joined.items()}
        rest = {name: v[stop - self._first :] for name, v in joined.items()}
        self._held, self._first = [rest], stop
        return taken

    def skip(self, stop: int) -> None:
        """Drop rows up to `stop`, a batch at a time."""
        while self._first < stop:
            self.take(self._first, min(stop, max(self._stop, self._first + 1)))


def _joined(parts: list[dict[str, NDArray[Any]]]) -> dict[str, NDArray[Any]]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _drop(rows: _Rows, segment: Segment) -> None:
    try:
        rows.skip(segment.stop)
    except BadInputError:
        return


def key_of(value: Any) -> str:
    """An identifier as text, whole numbers without a point."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return str(value)
