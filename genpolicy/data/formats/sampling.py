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
from genpolicy.data.formats.contract import Labels
from genpolicy.data.formats.source import RawEpisode, Source, as_float

SAMPLE_EPISODES = 12
FROM_ONE_CLOCK = 2


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
