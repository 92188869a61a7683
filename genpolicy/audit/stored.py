"""Does the place in the files tell the modes? Where no clock runs on, it may be the order.

The place is no time: whoever merges, renames or shuffles files gives it another meaning. So nothing
is denied by it, and no order is believed for it. But episodes that were dealt to their places
without regard to their modes have no pattern there, whatever the places mean. A pattern that chance
gives once in a thousand data sets was either made at recording (sides taken in turns, or by
session) or by somebody who knew the modes when the files were sorted; both are a label that was
not recorded. Where there is none the evidence is that of any other order, to the byte.

A pattern that chance gives once in a hundred is not believed, and nothing is denied beside it: what
the places tell is then open.
"""

import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy import stats
from scipy.sparse.csgraph import connected_components

from genpolicy.audit.choices import Choices
from genpolicy.audit.data import Array, AuditInput, Integers, Text
from genpolicy.audit.turns import pattern
from genpolicy.seeds import stream
from genpolicy.statistics.conditional import ConditionalTest, conditional_test

# Chance of a pattern where there is none, and draws that resolve it.
LEVEL, DRAWS = 0.001, 4999
FEW_DRAWS = 199  # what chance explains, in the mean
# From here on a pattern is neither believed nor denied.
OPEN_LEVEL = 0.01
# Files that somebody sorted by the length of the episodes, which follows from the way: no sequence.
SORTED = 0.9
# What the row says of itself.
STORED = "by their places in the files"


def places(labels: Iterable[str]) -> Array | None:
    """Rank of each episode by its label, numbers as numbers; None where two are called the same."""
    texts = list(labels)
    if len(set(texts)) < max(2, len(texts)):
        return None
    order = sorted(range(len(texts)), key=lambda number: _natural(texts[number]))
    rank = np.empty(len(texts))
    rank[order] = np.arange(len(texts))
    return rank


def sequence_test(
    data: AuditInput,
    place: Array,
    links: Integers,
    drawn: tuple[Integers, Integers, Integers],
    *,
    seeds: tuple[int, str],
) -> ConditionalTest | None:
    """The modes of episodes nearby against the own one; None unless there is a pattern.

    Args:
        data: Canonical audit input.
        place: Place of each episode in a sequence. Shape (E,).
        links: Mode of each episode, -1 for none. Shape (E,).
        drawn: Rows, modes and situation of rows of different episodes. Shapes (n,).
        seeds: Root seed and phase.
    """
    rows, _, blocks = drawn
    linked = links[data.episode[rows]] >= 0
    episode, blocks = data.episode[rows][linked], blocks[linked]
    if len(episode) == 0 or _by_length(data, place):
        return None
    # Successes and failures in folders of their own: inside each the places mean something.
    cell = _numbered(data.episodes.outcome[episode]) + blocks * (len(data.episodes) + 1)
    rng = stream(seeds[0], "audit", "stored", seeds[1])
    found = pattern(_rank(place)[episode], links[episode], cell, rng=rng, draws=DRAWS)
    if not LEVEL - found.p_value >= 0:
        return None
    test = conditional_test(links[episode], found.guessed, cell, rng=rng, permutations=FEW_DRAWS)
    return replace(test, p_value=found.p_value)


def sequence_hits(
    data: AuditInput, place: Array, chosen: Choices, *, seeds: tuple[int, str]
) -> tuple[Array, Array, bool] | None:
    """Which episodes' modes their neighbours in a sequence speak for; None without a pattern.

    Args:
        data: Canonical audit input.
        place: Place of each episode in the sequence. Shape (E,).
        chosen: Episodes that had a choice.
        seeds: Root seed and phase.

    Returns:
        Whether each was guessed by all its neighbours, and by the nearest ones, with the
        chance of a guess where there are none, shapes (n,); and whether the pattern is believed.
    """
    if len(chosen.episode) == 0 or _by_length(data, place):
        return None
    outcome = _numbered(data.episodes.outcome[chosen.episode])
    cell = outcome + _starts(chosen) * (len(data.episodes) + 1)
    rng = stream(seeds[0], "audit", "told by place", seeds[1])
    found = pattern(_rank(place)[chosen.episode], chosen.mode, cell, rng=rng, draws=DRAWS)
    if not OPEN_LEVEL - found.p_value >= 0:
        return None
    near, close = (
        np.where(guess >= 0, (guess == chosen.mode).astype(np.float64), chosen.chance)
        for guess in (found.guessed, found.by_nearest)
    )
    return near, close, bool(LEVEL - found.p_value >= 0)


def _starts(chosen: Choices) -> Integers:
    """Which modes each episode could choose between; those that share one stand together (n,)."""
    kinds = chosen.share.shape[1]
    beside = (chosen.allowed.T.astype(np.int64) @ chosen.allowed) > 0
    _, group = connected_components(beside, directed=False)
    return np.asarray(group[:kinds], dtype=np.int64)[chosen.mode]


def _rank(place: Array) -> Array:
    return np.argsort(np.argsort(place, kind="stable"), kind="stable").astype(np.float64)


def _by_length(data: AuditInput, stored: Array) -> bool:
    lengths = np.bincount(data.episode, minlength=len(data.episodes))
    if len(np.unique(lengths)) < 2:
        return False
    return abs(float(stats.spearmanr(stored, lengths).statistic)) >= SORTED


def _numbered(values: Text) -> Integers:
    return np.asarray(np.unique(values, return_inverse=True)[1].reshape(-1), dtype=np.int64)


def _natural(text: str) -> list[tuple[int, int, str]]:
    """What sorts `demo_10` behind `demo_9`."""
    parts = re.findall(r"\d+|\D+", text)
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts]
