"""Which column of tables says where an episode begins: its name, or of two names the rows.

`run` is the episode of one recorder and the session of another, with twenty episodes under one
value; every other name of the list says what it is. A session may be why its demonstrations differ
from those of the next, so it is asked as a reason, and its episodes begin where their clock does.
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
# So many values beside files are sessions; of one that comes twice by mistake there are more.
SHARED = 2.0 / 3.0
# Other recorders mean a session by these; any other name of the list says what it is.
SESSIONS = ("run", "run_id")
# These may count what is done in an episode, or the rows of all of them.
OTHER_COUNTERS = ("step", "index")
# A clock rises from row to row, and a number of rows by one, but for damage.
COUNTS = 0.9
# It begins anew where it falls back by more than this share of what it had reached.
FALLS = 0.5
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
    """What a pass over the files told of a column: its runs, and where a counter begins anew."""

    def __init__(self, counter: str | None, name: str | None, *, by_one: bool) -> None:
        """Nothing yet.

        Args:
            counter: Numbers or times of rows; None where there are none.
            name: Column that may be a session; None for none.
            by_one: Whether the counter rises by one.
        """
        self.counter, self.name, self._by_one = counter, name, by_one
        self.files = self._restarts = self._changes = self._inside = self._constant = 0
        self._steps = self._counted = 0
        self._keys: set[str] = set()

    def add(self, table: Table) -> None:
        """Look at one file, some thousand rows at a time."""
        before = self._changes
        names = [self.name] if self.name else []
        first = True
        for values, changed, anew in changes(table, self.counter, names):
            self._restarts += int(anew.sum())
            if self.counter is not None:
                steps = np.diff(as_float(values[self.counter]))[~anew[1:]]
                self._steps += len(steps)
                counted = np.abs(steps - 1.0) < 1e-9 if self._by_one else steps > 0.0
                self._counted += int(counted.sum())
            if self.name:
                self._changes += int(changed[self.name].sum())
                self._inside += int((anew & ~changed[self.name]).sum())
                if first:
                    self._keys.add(key_of(values[self.name][:1].tolist()[0]))
            first = False
        self._constant += self._changes == before
        self.files += 1

    @property
    def counts(self) -> bool:
        """Whether the counter counts rows."""
        return self._counted >= COUNTS * self._steps

    @property
    def is_session(self) -> bool:
        """Whether rows begin anew inside its values, or several files share one."""
        values = self._changes + self.files
        many = self.counts and self._inside >= max(LEAST_RESTARTS, RESTARTS_SHARE * values)
        # One value that comes twice is a copy or a mistake, which the import refuses by name.
        shared = self._constant == self.files and 1 < len(self._keys) <= SHARED * self.files
        return many or shared

    @property
    def begins_anew(self) -> bool:
        """Whether files hold several episodes, by their counter alone."""
        return self.counts and self._restarts >= max(LEAST_RESTARTS, RESTARTS_SHARE * self.files)


def episode_column(
    tables: Callable[[], Iterator[Table]], columns: Mapping[str, Column], labels: Labels
) -> EpisodeColumn:
    """The column of the episodes of some tables.

    Args:
        tables: Gives every readable file.
        columns: The columns that the files have.
        labels: What the names say; its `time` or `frame` counts the rows of an episode.
    """
    names = [c.name for c in columns.values() if c.width is None]
    by_name = {name.lower(): name for name in reversed(names)}
    called = [by_name[name] for name in NAMES["episode"] if name in by_name]
    if called and called[0].lower() not in SESSIONS:
        return EpisodeColumn(called[0])
    numbers = {c.name for c in columns.values() if c.width is None and c.kind == "number"}
    counters = [
        name
        for name in (labels.time, labels.frame)
        if name in numbers and name is not None and name.lower() not in OTHER_COUNTERS
    ]
    counter, name = counters[0] if counters else None, called[0] if called else None
    if counter is None and name is None:
        return EpisodeColumn(None)
    looked = _looked(tables, counter, name, by_one=counter != labels.time)
    if name is None:
        note = f"An episode begins where {counter} begins anew."
        return EpisodeColumn(None, counter, (note,)) if looked.begins_anew else EpisodeColumn(None)
    if not looked.is_session:
        return EpisodeColumn(name)
    found = f"{name} has one value for several episodes: "
    if looked.begins_anew:
        note = f"{found}an episode begins where {counter} begins anew; {name} is asked as a reason."
        return EpisodeColumn(name, counter, (note,))
    return EpisodeColumn(
        None, None, (f"{found}each file is an episode; {name} is asked as a reason.",)
    )


def _looked(
    tables: Callable[[], Iterator[Table]], counter: str | None, name: str | None, *, by_one: bool
) -> Looked:
    looked = Looked(counter, name, by_one=by_one)
    for table in tables():
        single = {c.name for c in table.columns.values() if c.width is None}
        if {counter, name} - {None} <= single:
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

    A counter begins anew where it falls most of the way back to the first value of the file.
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
            reached = np.concatenate([[float(before[counter]) if before else first], numbers[:-1]])
            anew = (numbers < reached) & (numbers - first <= FALLS * (reached - first))
        before = {name: values[name][-1] for name in wanted}
        yield values, changed, anew


def _changed(values: NDArray[Any], before: Any) -> Flags:
    same = values[1:] == values[:-1]
    begins = before is not None and bool(values[0] != before)
    return np.concatenate([[begins], ~same])
