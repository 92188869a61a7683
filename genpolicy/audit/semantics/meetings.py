"""Which episodes that meet may agree on so much that they are copies? Of many meetings at once.

Two demonstrations of one way come near each other here and there: most of what meets is no copy,
and need not be compared row by row.
"""

import numpy as np

from genpolicy.audit.data import Array, Flags, Integers

# Rows on each side of a meeting that are looked at, and meetings at a time.
LOOKED_AT, BLOCK = 32, 4096


def may_cover(
    signal: Array,
    starts: Integers,
    rows: Integers,
    *,
    near: float,
    least: int,
    own: float,
    of: float,
) -> Flags:
    """Which meetings are of two episodes that may agree on enough rows.

    All stretches that agree around the meetings of two episodes, added up though they overlap, are
    never less than the rows on which the two agree there.

    Args:
        signal: Shape (M, D).
        starts: First row of each episode, and their number. Shape (E + 1,).
        rows: Rows that meet, in any two episodes or in one. Shape (m, 2).
        near: Rows further apart disagree, unit of the signal.
        least: Shorter stretches do not count.
        own: Share of an episode that agrees with itself elsewhere.
        of: Share of the shorter of two episodes.

    Returns:
        Shape (m,).
    """
    episode = np.searchsorted(starts, rows, side="right") - 1
    agree = _agree_at_most(signal, starts, rows, near)
    length = np.diff(starts)[episode].min(axis=1)
    needed = np.where(episode[:, 0] == episode[:, 1], own, of) * length
    pair = np.unique(episode, axis=0, return_inverse=True)[1].reshape(-1)
    bound = np.bincount(pair, weights=np.where(agree >= least, agree, 0))
    return np.asarray(bound[pair] - needed >= 0, dtype=bool)


def _agree_at_most(signal: Array, starts: Integers, rows: Integers, near: float) -> Integers:
    """Rows around each meeting that agree; all there are where the end is out of sight (m,)."""
    parts = [
        _agree(signal, starts, rows[first : first + BLOCK], near)
        for first in range(0, len(rows), BLOCK)
    ]
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


def _agree(signal: Array, starts: Integers, rows: Integers, near: float) -> Integers:
    episode = np.searchsorted(starts, rows, side="right") - 1
    back = (rows - starts[episode]).min(axis=1)[:, None]
    on = (starts[episode + 1] - rows).min(axis=1)[:, None]
    offsets = np.arange(-LOOKED_AT, LOOKED_AT)
    at = np.clip(offsets, -back, on - 1)
    gap = signal[rows[:, :1] + at] - signal[rows[:, 1:] + at]
    ends = (offsets < -back) | (offsets >= on) | (np.linalg.norm(gap, axis=2) > near)
    before, after = ends[:, LOOKED_AT - 1 :: -1], ends[:, LOOKED_AT:]
    return np.asarray(_first(before, back[:, 0]) + _first(after, on[:, 0]), dtype=np.int64)


def _first(ends: Array, most: Integers) -> Integers:
    """Steps to the first end; `most` where none is in sight. Shape (m,)."""
    return np.asarray(np.where(ends.any(axis=1), np.argmax(ends, axis=1), most), dtype=np.int64)
