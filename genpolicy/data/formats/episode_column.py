"""Which column of tables says where an episode begins: its name proposes, the rows decide.

`run` is the episode of one recorder and the session of another, with twenty episodes under one
value. An identifier of episodes changes where rows begin anew; one that stays is a session, which
may be why its demonstrations differ from those of the next.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.columns import NAMES
from genpolicy.data.formats.contract import Labels
from genpolicy.data.formats.segments import Segment, key_of
from genpolicy.data.formats.source import Column, as_float
from genpolicy.data.formats.tables import Table, batches
from genpolicy.errors import BadInputError

# Fewer rows that begin anew inside a value are damage.
LEAST_RESTARTS, RESTARTS_SHARE = 2, 0.5
# Other recorders mean a session by these; any other name of the list says what it is.
SESSIONS = ("run", "run_id")
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class EpisodeColumn:
    """Where episodes begin.

    Attributes:
        name: The column that changes with the episode; None where files are the episodes.
        restart: The counter that begins anew with each episode, where no column changes there.
        notes: What was taken, a sentence each.
    """

    name: str | None
    restart: str | None = None
    notes: tuple[str, ...] = ()


class Looked:
    """What a pass over the files told of columns: their runs, and where a counter begins anew."""

    def __init__(self, counter: str | None, names: Sequence[str]) -> None:
        """Nothing yet.

        Args:
            counter: Numbers or times of rows; None where there are none.
            names: Columns that may change with the episode.
        """
        self.counter, self.names = counter, names
        self.files = self.restarts = 0
        self._changes: Counter[str] = Counter()
        self._inside: Counter[str] = Counter()
        self._outside: Counter[str] = Counter()
        self._constant: Counter[str] = Counter()
        self._keys: dict[str, set[str]] = {name: set() for name in names}

    def add(self, table: Table) -> None:
        """Look at one file, some thousand rows at a time."""
        before = Counter(self._changes)
        keys: dict[str, str] = {}
        for values, changed, anew in changes(table, self.counter, self.names):
            self.restarts += int(anew.sum())
            for name in self.names:
                self._changes[name] += int(changed[name].sum())
                self._inside[name] += int((anew & ~changed[name]).sum())
                self._outside[name] += int((changed[name] & ~anew).sum())
                keys.setdefault(name, key_of(values[name][:1].tolist()[0]))
        for name, key in keys.items():
            self._constant[name] += self._changes[name] == before[name]
            self._keys[name].add(key)
        self.files += 1

    def is_session(self, name: str) -> bool:
        """Whether rows begin anew inside its values, or several files share one."""
        values = self._changes[name] + self.files
        many = self._inside[name] >= max(LEAST_RESTARTS, RESTARTS_SHARE * values)
        shared = self._constant[name] == self.files and 1 < len(self._keys[name]) < self.files
        return many or shared

    @property
    def begins_anew(self) -> bool:
        """Whether files hold several episodes, by their counter alone."""
        return self.restarts >= max(LEAST_RESTARTS, RESTARTS_SHARE * self.files)

    def agrees(self, name: str) -> bool:
        """Whether it changes where the counter begins anew, and nowhere else."""
        return self.begins_anew and not self._inside[name] and not self._outside[name]


def episode_column(
    tables: Callable[[], Iterator[Table]], columns: Mapping[str, Column], labels: Labels
) -> EpisodeColumn:
    """The column of the episodes of some tables.

    Args:
        tables: Gives every readable file.
        columns: The columns that the files have.
        labels: What the names say; its `frame` or `time` counts the rows of an episode.
    """
    names = [c.name for c in columns.values() if c.width is None]
    by_name = {name.lower(): name for name in reversed(names)}
    called = [by_name[name] for name in NAMES["episode"] if name in by_name]
    numbers = {c.name for c in columns.values() if c.width is None and c.kind == "number"}
    counters = [n for n in (labels.frame, labels.time) if n in numbers]
    if not called and not counters:
        return EpisodeColumn(None)
    looked = _looked(tables, counters[0] if counters else None, called)
    sessions = [name for name in called if looked.is_session(name)]
    good = [name for name in called if name not in sessions]
    if good and not (sessions and called.index(sessions[0]) < called.index(good[0])):
        return EpisodeColumn(good[0])
    if not sessions and not looked.begins_anew:
        return EpisodeColumn(None)
    labelled = set(labels.named().values())
    others = [name for name in names if name not in labelled and name not in called]
    if not good and looked.begins_anew:
        again = _looked(tables, looked.counter, others)
        good = [name for name in sorted(others) if again.agrees(name)][:1]
    return _without_name(looked, sessions[0] if sessions else None, good)


def _without_name(looked: Looked, session: str | None, good: Sequence[str]) -> EpisodeColumn:
    """Where episodes begin, if not where the column does whose name says so."""
    asked = f"; {session} is asked as a reason." if session else "."
    found = f"{session} has one value for several episodes: " if session else ""
    if good:
        return EpisodeColumn(good[0], notes=(f"{found}{good[0]} was taken for the episode{asked}",))
    if not looked.begins_anew:
        return EpisodeColumn(None, notes=(f"{found}each file is an episode{asked}",))
    if session is not None and session.lower() not in SESSIONS:
        # By its name it is an episode, and rows that begin anew in one are refused.
        return EpisodeColumn(session)
    begins = f"{'an' if found else 'An'} episode begins where {looked.counter} begins anew"
    note = f"{found}{begins}{asked}"
    return EpisodeColumn(session, looked.counter, (note,))


def _looked(
    tables: Callable[[], Iterator[Table]], counter: str | None, names: Sequence[str]
) -> Looked:
    looked = Looked(counter, names)
    for table in tables():
        single = {c.name for c in table.columns.values() if c.width is None}
        if {counter, *names} - {None} <= single:
            with suppress(BadInputError):  # the import refuses what is damaged, by its name
                looked.add(table)
    return looked


def restarted(table: Table, column: str | None, counter: str) -> list[Segment]:
    """Rows between two places where a counter begins anew or a column changes."""
    named = [] if column is None else [column]
    edges: list[int] = [0]
    keys: list[str] = []
    done = 0
    for values, changed, anew in changes(table, counter, named):
        begins = anew if column is None else anew | changed[column]
        starts = np.flatnonzero(begins)
        edges += (done + starts).tolist()
        if column is not None:
            first = [0] if done == 0 else []
            keys += map(key_of, values[column][[*first, *starts]].tolist())
        done += len(anew)
    seen: Counter[str] = Counter()
    segments = []
    for number, (start, stop) in enumerate(pairwise([*edges, done])):
        key = keys[number] if column is not None else ""
        name = f"{key}.{seen[key]}" if column is not None else str(number)
        segments.append(Segment(name, start, stop))
        seen[key] += 1
    return segments


def changes(
    table: Table, counter: str | None, names: Sequence[str]
) -> Iterator[tuple[dict[str, NDArray[Any]], dict[str, Flags], Flags]]:
    """Values, where each column changes, and where a counter begins anew, batch by batch.

    A counter begins anew where it falls back to the first value of the file or below.
    """
    wanted = list(dict.fromkeys([*names, *([counter] if counter else [])]))
    before: dict[str, Any] = {}
    first = np.nan
    for values in batches(table, wanted):
        length = len(next(iter(values.values())))
        if not length:
            continue
        changed = {name: _changed(values[name], before.get(name)) for name in names}
        anew = np.zeros(length, dtype=bool)
        if counter is not None:
            numbers = as_float(values[counter])
            first = numbers[0] if not before else first
            last = float(before[counter]) if before else numbers[0]
            anew = (np.diff(numbers, prepend=last) < 0.0) & (numbers <= first)
        before = {name: values[name][-1] for name in wanted}
        yield values, changed, anew


def _changed(values: NDArray[Any], before: Any) -> Flags:
    same = values[1:] == values[:-1]
    begins = before is not None and bool(values[0] != before)
    return np.concatenate([[begins], ~same])
