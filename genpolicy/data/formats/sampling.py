"""The few episodes that a contract is proposed from: chosen by what they hold, not by their place.

Otherwise the same recordings in another order, or two collections merged the other way round,
would be read under another contract.
"""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import pairwise

import numpy as np

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.columns import GUESSED
from genpolicy.data.formats.contract import Labels
from genpolicy.data.formats.interventions import flags_in
from genpolicy.data.formats.source import Column, RawEpisode, Source, as_float
from genpolicy.data.formats.units import tokens

# So many that a fault in a third of the episodes is not, by luck, in half of those that are read.
SAMPLE_EPISODES = 80
FROM_ONE_CLOCK = 2
# Of whole numbers: so few are labels, and so many rows on average make no flicker.
MOST_LABELS, LONGEST_FLICKER = 12, 8
HANDS = {"gripper", "hand", "finger", "jaw", "grasp", "contact", "contacts"}
SETTLED = ("task", "object", "operator", "calibration_epoch", "is_recovery")
SWITCHING_SHARE = 0.25


@dataclass(frozen=True)
class Sampled:
    """What a pass over the recordings gave.

    Attributes:
        episodes: Some of the episodes, in an order that rests on what they hold; those without
            NaN or infinity first, since what the import will refuse must not decide.
        one_clock: Whether each episode begins after another has ended: one clock for all.
        reason: Why the first unreadable episode could not be read.
    """

    episodes: list[RawEpisode]
    one_clock: bool
    reason: str


def sample_episodes(source: Source, columns: Sequence[str], labels: Labels) -> Sampled:
    """Read every episode once and keep a few of them.

    Args:
        source: The recordings.
        columns: The columns that say which to keep: those of observation and action.
        labels: Labels that are read beside them; one of them may be the clock.
    """
    wanted = list(dict.fromkeys([*columns, *labels.named().values()]))
    kept: list[tuple[bool, int, int, RawEpisode]] = []
    spans: list[tuple[float, float]] = []
    reason = ""
    for number, item in enumerate(source.episodes(wanted, labels.episode)):
        if isinstance(item, Refusal):
            reason = reason or item.reason
            continue
        if not len(item.columns[columns[0]]):
            continue
        spans += _span(item, labels)
        # The heap gives up its smallest first: finite ones stay, then those of smallest digest.
        entry = (_is_finite(item, columns), -_digest(item, columns), -number, item)
        if len(kept) < SAMPLE_EPISODES:
            heapq.heappush(kept, entry)
        else:
            heapq.heappushpop(kept, entry)
    finite = [entry for entry in kept if entry[0]] or kept
    chosen = [entry[3] for entry in sorted(finite, key=lambda entry: entry[1], reverse=True)]
    return Sampled(chosen, _is_one_clock(spans), reason or "it holds no episode")


def _digest(episode: RawEpisode, columns: Sequence[str]) -> int:
    digest = sha256()
    for name in columns:
        digest.update(np.ascontiguousarray(episode.columns[name]).tobytes())
    return int.from_bytes(digest.digest()[:8], "big")


def _is_finite(episode: RawEpisode, columns: Sequence[str]) -> bool:
    return all(bool(np.isfinite(as_float(episode.columns[name])).all()) for name in columns)


def _span(episode: RawEpisode, labels: Labels) -> list[tuple[float, float]]:
    """First and last time of an episode on the recorded clock, if there is one."""
    if labels.time is None:
        return []
    times = as_float(episode.columns[labels.time]).reshape(-1)
    return [(float(times[0]), float(times[-1]))]


def _is_one_clock(spans: list[tuple[float, float]]) -> bool:
    ordered = sorted(spans)
    apart = all(after[0] > before[1] for before, after in pairwise(ordered))
    return len(ordered) >= FROM_ONE_CLOCK and apart


def settled(labels: Labels, sample: Sequence[RawEpisode], notes: list[str]) -> Labels:
    """The labels without those whose value switches inside episodes: they are values by row.

    One episode in which a label changes is damaged; if it is a quarter of them, they mean it so.
    A name that need not mean interventions (`takeover`) is their label only where it holds flags.
    """
    name = labels.is_intervention
    guessed = name is not None and name.lower() in GUESSED
    if guessed and any(flags_in(episode, name) is None for episode in sample):
        notes.append(f"{name} holds no flags: it is a column, not the label of interventions.")
        labels = labels.model_copy(update={"is_intervention": None})
    unsettled = {
        label: column
        for label in SETTLED
        if (column := getattr(labels, label)) is not None
        and _switching(column, sample) >= max(2.0, SWITCHING_SHARE * len(sample))
    }
    for column in unsettled.values():
        notes.append(f"{column} switches inside episodes: it is held against the modes row by row.")
    return labels.model_copy(update=dict.fromkeys(unsettled))


def labels_among(columns: Sequence[Column], sample: Sequence[RawEpisode]) -> list[str]:
    """Columns that look like labels of the episodes, and not like what a sensor measures.

    A few whole numbers that hold for the whole episode, or for long; the state of a hand may
    switch like that, and is measured.
    """
    return [c.name for c in columns if c.width is None and _is_label(c.name, sample)]


def _is_label(name: str, sample: Sequence[RawEpisode]) -> bool:
    parts = [episode.columns[name] for episode in sample]
    values = np.unique(np.concatenate(parts))
    if values.dtype.kind not in "iub" or not 1 < len(values) <= MOST_LABELS:
        return False
    switches = [int(np.count_nonzero(part[1:] != part[:-1])) for part in parts]
    if not any(switches):
        return True
    held = sum(map(len, parts)) / (sum(switches) + len(parts))
    return held >= LONGEST_FLICKER and not HANDS & set(tokens(name))


def _switching(column: str, sample: Sequence[RawEpisode]) -> int:
    return sum(
        bool(np.any(values != values[0]))
        for episode in sample
        if len(values := episode.columns.get(column, np.zeros(0)))
    )
