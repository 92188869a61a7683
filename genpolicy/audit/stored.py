"""Does the place in the files tell the modes? Where no clock runs on, it may be the order.

The place is no time: whoever merges, renames or shuffles files gives it another meaning. So nothing
is denied by it, and no order is believed for it. But episodes that were dealt to their places
without regard to their modes have no pattern there, whatever the places mean. A pattern that chance
gives once in a thousand data sets was either made at recording (sides taken in turns, or by
session) or by somebody who knew the modes when the files were sorted; both are a label that was
not recorded. Where there is none the evidence is that of any other order, to the byte.
"""

import re
from collections.abc import Iterable

import numpy as np
from scipy import stats

from genpolicy.audit.data import Array, AuditInput, Integers, Text
from genpolicy.seeds import stream
from genpolicy.statistics.conditional import ConditionalTest, conditional_test

# Chance of a pattern where there is none, and draws that resolve it.
LEVEL, DRAWS = 0.001, 4999
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
    nearby: Integers,
    drawn: tuple[Integers, Integers, Integers],
    *,
    seeds: tuple[int, str],
) -> ConditionalTest | None:
    """The modes of episodes stored nearby against the own one; None unless there is a pattern.

    Args:
        data: Canonical audit input, with places.
        nearby: Most frequent mode near each episode. Shape (E,).
        drawn: Rows, modes and situation of rows of different episodes. Shapes (n,).
        seeds: Root seed and phase.
    """
    rows, labels, blocks = drawn
    if data.stored is None or len(rows) == 0 or _by_length(data, data.stored):
        return None
    episode = data.episode[rows]
    # Successes and failures in folders of their own: inside each the places mean something.
    cell = _numbered(data.episodes.outcome[episode]) + blocks * (len(data.episodes) + 1)
    test = conditional_test(
        labels,
        nearby[episode],
        cell,
        rng=stream(seeds[0], "audit", "stored", seeds[1]),
        permutations=DRAWS,
    )
    return test if LEVEL - test.p_value >= 0 else None


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
