"""How many rows a signal trails another, for many short segments at once.

For each whole shift the variance of the gap between the two is taken over the rows that both
have; a constant offset between them does not count. Around the best shift a parabola through
three shifts on one set of rows gives the fraction. Cost: shifts times rows.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from genpolicy.audit.data import Array, Integers
from genpolicy.audit.semantics.robust import episode_centred, episode_sums

BLOCK_ROWS = 50_000
LEAST_ROWS = 12
# A component's noise is taken no lower than this share of its motion, so that a component that
# follows perfectly does not silence all others.
NOISE_SHARE = 1e-3
# Rows of one segment are not independent: the standard error is taken this much larger.
CORRELATION = 3.0
# A lag that is known worse than this, in steps, is not known.
LARGEST_ERROR = 0.5
# Share of the variance that may be left at the best shift; above it one does not follow the other.
UNEXPLAINED = 0.5


@dataclass(frozen=True)
class Lags:
    """Lag of each segment and its standard error, steps; NaN where unknown. Shapes (S,)."""

    steps: Array
    error: Array


def segment_lags(leading: Array, trailing: Array, starts: Integers, maximum_rows: int) -> Lags:
    """By how many rows `trailing` comes later than `leading`.

    Args:
        leading: Shape (N, P).
        trailing: The same quantity, later. Shape (N, P).
        starts: First row of each segment and the number of rows. Shape (S + 1,).
        maximum_rows: Largest lag that is looked for, both ways; less in short segments.
    """
    count = len(starts) - 1
    steps, error = np.full(count, np.nan), np.full(count, np.nan)
    if leading.shape[1] == 0 or count == 0:
        return Lags(steps, error)
    leading, trailing = episode_centred(leading, starts), episode_centred(trailing, starts)
    shifts = np.arange(-maximum_rows, maximum_rows + 1)
    gaps = np.concatenate(
        [
            _gap_variances(leading, trailing, starts[first : last + 1], shifts)
            for first, last in _blocks(starts)
        ]
    )
    length = np.diff(starts)
    gaps[length[:, None] - np.abs(shifts) < np.maximum(8, 0.5 * length)[:, None]] = np.inf
    weights = _weights(gaps, leading, trailing, starts)
    with np.errstate(invalid="ignore"):
        summed = np.einsum("stp,sp->st", gaps, weights)
    total = np.where(np.isfinite(gaps[:, :, 0]), summed, np.inf)
    usable = (length >= LEAST_ROWS) & np.isfinite(total).any(axis=1)
    best = shifts[np.argmin(total, axis=1)]
    left, centre, right, rows = _around(leading, trailing, starts, best, weights)
    power = (episode_sums(trailing**2, starts) * weights).sum(axis=1) / np.maximum(length, 1)
    bend = left - 2.0 * centre + right
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.clip(0.5 * (left - right) / bend, -1.0, 1.0)
        # The weights are one over the noise, so the bend counts in units of the noise.
        spread = CORRELATION / np.sqrt(rows * 0.5 * bend)
    usable &= (bend > 0) & (rows >= 4) & (centre <= UNEXPLAINED * power)
    usable &= spread <= LARGEST_ERROR
    steps[usable] = (best + offset)[usable]
    error[usable] = spread[usable]
    return Lags(steps, error)


def _blocks(starts: Integers) -> list[tuple[int, int]]:
    """Runs of whole segments with about `BLOCK_ROWS` rows: bounds the memory."""
    edges = [0]
    while edges[-1] < len(starts) - 1:
        reach = int(np.searchsorted(starts, starts[edges[-1]] + BLOCK_ROWS, side="right")) - 1
        edges.append(min(max(reach, edges[-1] + 1), len(starts) - 1))
    return list(pairwise(edges))


def _gap_variances(leading: Array, trailing: Array, starts: Integers, shifts: Integers) -> Array:
    """Variance of trailing[t + shift] - leading[t] by segment. Shape (S, shifts, P)."""
    rows = slice(int(starts[0]), int(starts[-1]))
    lead, trail = leading[rows], trailing[rows]
    local = starts - starts[0]
    length = np.diff(local)
    segment = np.repeat(np.arange(len(length)), length)
    result = np.empty((len(length), len(shifts), lead.shape[1]))
    for number, shift in enumerate(shifts):
        late, size = int(shift), len(lead) - abs(int(shift))
        gap = np.zeros_like(lead)
        if size > 0:
            at, then = slice(max(-late, 0), max(-late, 0) + size), slice(max(late, 0), None)
            then = slice(then.start, then.start + size)
            same = (segment[at] == segment[then])[:, None]
            gap[at] = np.where(same, trail[then] - lead[at], 0.0)
        count = np.maximum(length - abs(late), 1)[:, None]
        mean = episode_sums(gap, local) / count
        result[:, number] = np.maximum(episode_sums(gap**2, local) / count - mean**2, 0.0)
    return result


def _weights(gaps: Array, leading: Array, trailing: Array, starts: Integers) -> Array:
    """One over the noise of each component in each segment; 0 for one that does not move.

    A component that follows its command worse than usual in one segment (a finger that is stopped)
    counts for less there.

    Returns:
        Shape (S, P).
    """
    length = np.maximum(np.diff(starts), 1)[:, None]
    motion = np.median(episode_sums(leading**2, starts) / length, axis=0)
    motion = np.minimum(motion, np.median(episode_sums(trailing**2, starts) / length, axis=0))
    mean = np.mean(episode_sums(leading**2, starts) / length, axis=0)
    motion = np.where(motion > 0, motion, 1e-3 * mean)
    best = np.min(gaps, axis=1)
    known = np.isfinite(best[:, 0])
    noise = np.median(best[known], axis=0) if known.any() else motion
    own = np.where(np.isfinite(best), best, 0.0)
    floor = np.maximum(noise, NOISE_SHARE * motion)
    return np.where(motion > 0, 1.0 / np.maximum(np.maximum(own, floor), 1e-300), 0.0)


def _around(
    leading: Array, trailing: Array, starts: Integers, best: Integers, weights: Array
) -> tuple[Array, Array, Array, Array]:
    """Weighted gap variance one before, at and one after the best shift, and the rows used."""
    length = np.diff(starts)
    rows = np.arange(len(leading))
    segment = np.repeat(np.arange(len(length)), length)
    target = rows + best[segment]
    valid = (target - 1 >= starts[:-1][segment]) & (target + 1 < starts[1:][segment])
    count = episode_sums(valid.astype(np.float64), starts)
    safe = np.maximum(count, 1.0)[:, None]
    found = []
    for step in (-1, 0, 1):
        at = np.clip(target + step, 0, len(rows) - 1)
        gap = np.where(valid[:, None], trailing[at] - leading, 0.0)
        mean = episode_sums(gap, starts) / safe
        variance = episode_sums(gap**2, starts) / safe - mean**2
        found.append((variance * weights).sum(axis=1))
    return found[0], found[1], found[2], count


def episode_lags(
    leading: Array, trailing: Array, starts: Integers, pieces: Integers, maximum_rows: int
) -> Lags:
    """Lag of each episode, from its longest piece without a splice. Shapes (E,)."""
    found = segment_lags(leading, trailing, pieces, maximum_rows)
    if len(pieces) == len(starts):
        return found
    owner = np.searchsorted(starts, pieces[:-1], side="right") - 1
    order = np.lexsort((np.arange(len(owner)), -np.diff(pieces), owner))
    _, first = np.unique(owner[order], return_index=True)
    longest = order[first]
    return Lags(found.steps[longest], found.error[longest])
