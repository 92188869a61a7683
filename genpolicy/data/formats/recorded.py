"""Which columns of the recordings may be the reason, and their values by episode.

Everything scalar that the contract uses for nothing else, and that holds for a while: a value that
changes from row to row is a signal, and what counts rows or judges the episode is no reason.
"""

from collections.abc import Sequence

import numpy as np

from genpolicy.data.formats.contract import ImportContract, selectors
from genpolicy.data.formats.leaves import leaves
from genpolicy.data.formats.source import Column, RawEpisode
from genpolicy.data.formats.units import tokens
from genpolicy.data.variables import Recorded, Runs, runs_of, varying

# What counts rows, episodes or files, and what comes of an episode instead of before it.
COUNTERS = {
    *("index", "frame_index", "step_index", "episode_index", "frame", "step", "timestamp"),
    *("episode_uuid", "num_samples", "rows", "n_rows", "chunk_index", "file_index"),
}
JUDGES = {
    *("reward", "rewards", "done", "dones", "terminal", "terminals", "terminated", "truncated"),
    *("success", "succeeded", "outcome", "discount"),
}
"""Words of what comes of an episode, wherever they end a name (`is_success`, `next.done`)."""
MEASURES = {"return", "returns", "score", "length", "duration", "mask", "next"}
"""Words that are one only by themselves: the length of a tool decides, that of an episode not."""
OF_AN_EPISODE = {
    *("episode", "episodes", "ep", "traj", "trajectory", "step", "steps", "action", "actions"),
    *("total", "sum", "mean", "max", "min", "cumulative", "final", "rate", "is", "was", "per"),
    *("valid", "pad", "padding", "attention", "loss", "sparse", "dense", "shaped", "env"),
}
"""Words that say nothing else beside one of these."""
ENDS = {("from", "index"), ("to", "index")}
FLAGS = ("is_first", "is_last", "is_terminal")
# A value must hold this many rows on average; less is a signal.
SHORTEST_RUN = 4
# In so few episodes it may flicker.
FLICKERING_SHARE = 0.05
SHOWN = 12


def may_be_reason(name: str) -> bool:
    """Whether a column of this name may be why demonstrations differ."""
    words = tokens(name)
    plain = name.lower().removeprefix("observation.")
    if plain in COUNTERS or plain in FLAGS or tuple(words[-2:]) in ENDS:
        return False
    if JUDGES & {*words[-1:]}:
        return False
    plainly = all(word in JUDGES | MEASURES | OF_AN_EPISODE or word.isdigit() for word in words)
    return not (plainly and (JUDGES | MEASURES) & {*words})


class Reasons:
    """Gathers, episode by episode, what else was recorded."""

    def __init__(self, contract: ImportContract) -> None:
        """Nothing that the contract reads is gathered twice."""
        texts = [text for channel in contract.channels for text in channel.columns]
        texts += contract.action.columns
        read = {selector.column for selector in selectors(texts, where="contract")}
        self._used = read | set(contract.labels.named().values())
        self._runs: dict[str, dict[str, Runs]] = {}
        self._episodes = 0
        self._flickering: dict[str, int] = {}

    def wants(self, column: Column) -> bool:
        """Whether the values of a column are to be read."""
        plain = column.width is None and column.name not in self._used
        return plain and may_be_reason(column.name)

    def add(self, raw: RawEpisode, uuid: str) -> None:
        """Remember what was recorded of an accepted episode."""
        self._episodes += 1
        for name, values in raw.columns.items():
            if values.ndim != 1 or not len(values) or not self.wants(Column(name, None)):
                continue
            if isinstance(values[0], str) and np.all(values == values[0]):
                self._keep(name, values[0], uuid)
                continue
            runs = runs_of(values)
            if len(runs.rows) > max(2, len(values) // SHORTEST_RUN):
                self._flickering[name] = self._flickering.get(name, 0) + 1
            else:
                self._runs.setdefault(name, {})[uuid] = runs
        for name, text in raw.attributes.items():
            if name not in raw.columns and self.wants(Column(name, None)):
                self._keep(name, text, uuid)

    def _keep(self, name: str, text: str, uuid: str) -> None:
        """What holds for an episode; part by part, where it was written as one JSON object."""
        for part, said in leaves(name, text).items():
            if part == name or self.wants(Column(part, None)):
                self._runs.setdefault(part, {})[uuid] = Runs((0,), (said,))

    def recorded(self) -> Recorded:
        """What varies; a value that is the same everywhere tells nothing."""
        kept = {name: runs for name, runs in self._runs.items() if not self._is_signal(name)}
        return varying(kept, self._episodes)

    def notes(self, columns: Sequence[Column]) -> list[str]:
        """What was recorded and is not looked at as a reason, a sentence each."""
        notes: list[str] = []
        wide = [c.name for c in columns if c.width is not None and c.name not in self._used]
        if wide:
            notes.append(f"Not looked at as a reason, several numbers wide: {_listed(wide)}.")
        signals = [name for name in sorted(self._flickering) if self._is_signal(name)]
        if signals:
            notes.append(f"Not looked at as a reason, changes row by row: {_listed(signals)}.")
        return notes

    def _is_signal(self, name: str) -> bool:
        return self._flickering.get(name, 0) > FLICKERING_SHARE * self._episodes


def _listed(names: Sequence[str]) -> str:
    rest = len(names) - SHOWN
    return ", ".join(names[:SHOWN]) + (f" and {rest} more" if rest > 0 else "")
