"""Which columns of the recordings may be the reason, and their values by episode.

Everything that the contract uses for nothing else, and that holds for a while: a value that
changes from row to row is a signal, and what counts rows or comes of the episode is no reason.
Whatever is left out is noted by its name.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.consequences import counts_rows, is_called_measured, may_be_reason
from genpolicy.data.formats.contract import ImportContract, selectors
from genpolicy.data.formats.interventions import Interventions
from genpolicy.data.formats.leaves import MAXIMUM_LEAVES, SPANS, WIDEST, leaves, vector_of
from genpolicy.data.formats.source import Column, RawEpisode
from genpolicy.data.formats.vectors import MOST_DIFFERENT, Vectors, starts_of
from genpolicy.data.variables import Recorded, Runs, runs_of, varying

# A value must hold this many rows on average; less is a signal.
SHORTEST_RUN = 4
# In so few episodes it may flicker.
FLICKERING_SHARE = 0.05
SHOWN = 12
# A setting comes again; a measurement is another number in most episodes.
MEASURED_SHARE = 0.5
# Of one observed column that the contract reads in part.
MOST_ELEMENTS = 64
PARTS = "says what was done and when"
UNEVEN = "no numbers in an episode, or rows of different widths"


class Reasons:
    """Gathers, episode by episode, what else was recorded."""

    def __init__(self, contract: ImportContract) -> None:
        """Nothing that the contract reads is gathered twice."""
        texts = [text for channel in contract.channels for text in channel.columns]
        seen = selectors(texts, where="contract")
        done = {item.column for item in selectors(contract.action.columns, where="contract")}
        read = {item.column for item in seen} | done
        self._elements = {(item.column, item.element) for item in seen}
        # What is left out of an action is still done, not a reason for it.
        self._partly = {item.column for item in seen} - done
        self._interventions = Interventions(contract.labels.is_intervention)
        # No layer of the audit looks at that label, so its column is asked as any other.
        labels = contract.labels.model_copy(update={"is_intervention": None}).named()
        self._session = labels.pop("episode", None)
        self._used = read | set(labels.values())
        self._runs: dict[str, dict[str, Runs]] = {}
        self._vectors = Vectors()
        self._episodes = 0
        self._flickering: dict[str, int] = {}
        self._judging: set[str] = set()
        self._many: set[str] = set()
        self._cut: set[str] = set()
        self._left: dict[str, set[str]] = {}

    def wants(self, column: Column) -> bool:
        """Whether the values of a column are to be read."""
        name = column.name
        if name in self._used:
            return False
        if not may_be_reason(name):
            self._judging.add(name)
            return False
        return column.width is None or column.width <= WIDEST

    def add(self, raw: RawEpisode, uuid: str) -> None:
        """Remember what was recorded of an accepted episode."""
        self._episodes += 1
        for name, why in raw.left.items():
            if name not in self._used and may_be_reason(name):
                self._left.setdefault(why, set()).add(name)
        for name, values in self._with_elements(raw.columns):
            width = values.shape[1] if values.ndim == 2 else None
            if values.ndim > 2 or not len(values) or not self.wants(Column(name, width)):
                continue
            if width is not None:
                self._add_wide(name, values, uuid)
            elif isinstance(values[0], str) and np.all(values == values[0]):
                self._keep(name, values[0], uuid)
            else:
                self._add_runs(name, values, uuid)
        for name, text in raw.attributes.items():
            if name not in raw.columns and self.wants(Column(name, None)):
                self._keep(name, text, uuid)
        self._interventions.add(raw)

    def _with_elements(
        self, columns: Mapping[str, NDArray[Any]]
    ) -> Iterator[tuple[str, NDArray[Any]]]:
        """The columns, and each number of a wide one of which the contract reads some others."""
        for name, values in columns.items():
            yield name, values
            if name in self._partly and values.ndim == 2 and values.shape[1] <= WIDEST:
                others = [k for k in range(values.shape[1]) if (name, k) not in self._elements]
                if len(others) > MOST_ELEMENTS:
                    self._cut.add(name)
                for k in others[:MOST_ELEMENTS]:
                    yield f"{name}[{k}]", values[:, k]

    def _add_runs(self, name: str, values: NDArray[Any], uuid: str) -> None:
        runs = runs_of(values)
        if self._holds(name, len(runs.rows), len(values)):
            self._runs.setdefault(name, {})[uuid] = runs

    def _add_wide(self, name: str, values: NDArray[Any], uuid: str) -> None:
        if values.dtype.kind == "f" and np.isnan(values).all():
            self._left.setdefault(UNEVEN, set()).add(name)
            return
        starts = starts_of(values)
        if self._holds(name, len(starts), len(values)):
            self._vectors.add(name, uuid, starts, values[starts])

    def _holds(self, name: str, runs: int, rows: int) -> bool:
        """Whether values hold for a while in an episode; else it is counted."""
        flickers = runs > max(2, rows // SHORTEST_RUN)
        self._flickering[name] = self._flickering.get(name, 0) + flickers
        return not flickers

    def _keep(self, name: str, text: str, uuid: str) -> None:
        """What holds for an episode; part by part, where it was written as one JSON object."""
        parts = leaves(name, text)
        if len(parts) == MAXIMUM_LEAVES:
            self._many.add(name)
        for part, said in parts.items():
            if part != name and not self.wants(Column(part, None)):
                continue
            if said == SPANS:
                self._left.setdefault(PARTS, set()).add(part)
            elif (numbers := vector_of(said)) is not None:
                self._vectors.add(part, uuid, np.zeros(1), np.array([numbers]))
            else:
                self._runs.setdefault(part, {})[uuid] = Runs((0,), (said,))

    def recorded(self) -> Recorded:
        """What varies; a value that is the same everywhere tells nothing."""
        kept = self._lasting()
        if self._session in kept and self._names_each(kept[self._session]):
            del kept[self._session]
        for name in self._measured(kept):
            del kept[name]
        return varying(kept, self._episodes)

    def notes(self, columns: Sequence[Column]) -> list[str]:
        """What was recorded and is not looked at as a reason, a sentence each."""
        notes: list[str] = []
        unread = [c for c in columns if c.name not in self._used and c.name != self._session]
        wide = [c.name for c in unread if c.width is not None and c.width > WIDEST]
        signals = [name for name in sorted(self._flickering) if self._is_signal(name)]
        judging = [c.name for c in unread if not may_be_reason(c.name)]
        judging += sorted(self._judging - {*judging})
        # That rows and files have numbers is no news.
        judging = [name for name in judging if not counts_rows(name)]
        for names, why in (
            (wide, f"more than {WIDEST} numbers wide"),
            (signals, "changes row by row"),
            (judging, "counts rows or comes of the episode"),
            (self._measured(self._lasting()), "measured in the episode, another number in most"),
            (sorted(self._cut), f"all but the first {MOST_ELEMENTS} numbers that are not observed"),
            (self._vectors.overfull(), f"more than {MOST_DIFFERENT} different rows"),
            (sorted(self._many), f"all but the first {MAXIMUM_LEAVES} of its parts"),
            *((sorted(names), why) for why, names in sorted(self._left.items())),
        ):
            if names:
                notes.append(f"Not looked at as a reason, {why}: {_listed(names)}.")
        return notes + self._interventions.notes(self.recorded())

    def _lasting(self) -> dict[str, dict[str, Runs]]:
        """What was recorded and is no signal."""
        found = self._vectors.recorded()
        for name, runs in self._runs.items():
            # A text in some episodes and a list of numbers in others is one column of texts.
            found[name] = found.get(name, {}) | runs
        return {name: runs for name, runs in found.items() if not self._is_signal(name)}

    def _measured(self, found: Recorded) -> list[str]:
        """What is called a statistic of motion or load, and is another number in most episodes."""
        return [
            name
            for name, runs in sorted(found.items())
            if is_called_measured(name)
            and len({each.values for each in runs.values()}) > MEASURED_SHARE * len(runs)
        ]

    def _is_signal(self, name: str) -> bool:
        return self._flickering.get(name, 0) > FLICKERING_SHARE * self._episodes

    def _names_each(self, by_episode: Mapping[str, Runs]) -> bool:
        """Whether every episode has a value of its own."""
        return len({runs.values for runs in by_episode.values()}) == self._episodes


def _listed(names: Sequence[str]) -> str:
    rest = len(names) - SHOWN
    return ", ".join(names[:SHOWN]) + (f" and {rest} more" if rest > 0 else "")
