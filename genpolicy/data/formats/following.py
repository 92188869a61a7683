"""Does an observed number follow a commanded one, and does its place or its change follow?

Displacements over a few rows are compared, behind a lag: a *place* moves what it commands by as
much as it moves itself, a *change* by the sum of what it was meanwhile. Every episode has one vote
of what is explained with one gain for all, so that a fault in a minority of them decides nothing.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

LAGS = (-2, -1, 0, 1, 2, 3, 4, 6, 8, 12)
# Rows of a displacement: a short one sees fast motion, a long one sees through noise.
SPANS = (4, 12)
MINIMUM_SAMPLES = 20
LEAST_ROWS = 6
MOST_EPISODES = 80
# An episode in which a number moves less than this share of its usual power has no vote on it.
STILL = 0.05
# What is left unexplained, against what the command of another episode leaves; and the share from
# which on chance is no explanation.
BEYOND_CHANCE, CERTAIN = 0.5, 0.98
# Below this share of its size, what is left of a number is rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Following:
    """What each observed number owes to each commanded one. Arrays of shape (D_a, D_o).

    Attributes:
        explained: Share of the motion that the command explains in the median episode, at the
            best lag and span; 1 is all, 0 and less nothing.
        gain: Motion of the observed number per unit of the command; per unit and row of a change.
        beyond: Whether it explains more than the command of the next episode would, or all but
            nothing is left. Where all episodes do the same, any two numbers follow each other.
    """

    explained: Array
    gain: Array
    beyond: NDArray[np.bool_]


@dataclass(frozen=True)
class _Sums:
    """Products of displacements by episode. Shapes (E, D_a, D_o), (E, D_a) and (E, D_o)."""

    both: Array
    told: Array
    seen: Array


def places(
    observed: Array, commanded: Array, episode: Integers, *, gain: float | None = None
) -> Following:
    """How well each observed number goes where each command says.

    Args:
        observed: Shape (n, D_o).
        commanded: Shape (n, D_a).
        episode: Which episode each row belongs to, grouped. Shape (n,).
        gain: The gain to believe in; None measures it.
    """
    return _following(observed, commanded, episode, summed=False, gain=gain)


def changes(observed: Array, commanded: Array, episode: Integers) -> Following:
    """How well the change of each observed number follows the value of each command."""
    return _following(observed, commanded, episode, summed=True, gain=None)


def levels(observed: Array, commanded: Array, episode: Integers) -> Array:
    """How well each observed number is where each command says: an arm that is held tells by that.

    Returns:
        One minus the mean square gap of the median episode over the variance of the two, at the
        best lag. Shape (D_a, D_o).
    """
    best = np.full((commanded.shape[1], observed.shape[1]), -np.inf)
    if len(observed) < MINIMUM_SAMPLES or not best.size:
        return best
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        middle = observed.mean(axis=0), commanded.mean(axis=0)
        seen, told = observed - middle[0], commanded - middle[1]
        apart = middle[0] - middle[1][:, None]
        spread = 0.5 * ((seen**2).mean(axis=0) + (told**2).mean(axis=0)[:, None])
        for lag in (lag for lag in LAGS if lag >= 0):
            gaps = []
            for piece in _pieces(episode):
                o, a = seen[piece][lag:], told[piece][: max(len(told[piece]) - lag, 0)]
                if len(o) < LEAST_ROWS:
                    continue
                both = (o**2).mean(axis=0) + (a**2).mean(axis=0)[:, None] - 2.0 * a.T @ o / len(o)
                drift = o.mean(axis=0) - a.mean(axis=0)[:, None]
                gaps.append(both + 2.0 * apart * drift + apart**2)
            if gaps:
                best = np.fmax(best, 1.0 - np.median(gaps, axis=0) / spread)
    return np.where(np.isfinite(best), best, -np.inf)


def varies(values: Array) -> NDArray[np.bool_]:
    """Columns that are more than one number and its rounding. Shape (D,)."""
    if not len(values):
        return np.zeros(values.shape[1], dtype=bool)
    largest = np.max(np.abs(values), axis=0, initial=0.0)
    return np.asarray(np.ptp(values, axis=0) > ROUNDING * (1.0 + largest))


def _following(
    observed: Array, commanded: Array, episode: Integers, *, summed: bool, gain: float | None
) -> Following:
    shape = (commanded.shape[1], observed.shape[1])
    best = Following(np.full(shape, -np.inf), np.ones(shape), np.zeros(shape, dtype=bool))
    if len(observed) < MINIMUM_SAMPLES or not all(shape):
        return best
    # One scale for each number keeps tiny and huge ones apart from rounding.
    scales = [_scale(values) for values in (commanded, observed)]
    told, seen = commanded / scales[0], observed / scales[1]
    unit = scales[1] / scales[0][:, None]
    fixed = None if gain is None else gain / unit
    pieces = _pieces(episode)
    for span in SPANS:
        for lag in LAGS:
            moved = _displacements(told, seen, pieces, span=span, lag=lag, summed=summed)
            if moved is None:
                continue
            found = _votes(moved, fixed)
            better = found.explained > best.explained
            best = Following(
                np.where(better, found.explained, best.explained),
                np.where(better, found.gain * unit, best.gain),
                np.where(better, found.beyond, best.beyond),
            )
    return best


def _pieces(episode: Integers) -> list[slice]:
    """Rows of the episodes that have a vote: all of them, or some, evenly drawn."""
    edges = np.flatnonzero(np.diff(episode, prepend=episode[0] - 1, append=episode[-1] + 1))
    pieces = [slice(int(a), int(b)) for a, b in pairwise(edges)]
    kept = np.linspace(0, len(pieces) - 1, min(len(pieces), MOST_EPISODES)).astype(int)
    return [pieces[number] for number in np.unique(kept)]


def _scale(values: Array) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):
        spread = np.std(values, axis=0)
    return np.where(np.isfinite(spread) & (spread > 0.0), spread, 1.0)


def _displacements(
    told: Array, seen: Array, pieces: list[slice], *, span: int, lag: int, summed: bool
) -> list[tuple[Array, Array]] | None:
    """Commanded and observed displacements; None where most episodes are too short for them."""
    parts: list[tuple[Array, Array]] = []
    for piece in pieces:
        command, answer = told[piece], seen[piece]
        first, last = max(0, -lag), len(command) - span - max(0, lag)
        # The few windows of a long lag show one part of every episode: there, all is constant.
        if last - first < max(LEAST_ROWS, len(command) // 2):
            continue
        if summed:
            command = np.concatenate([np.zeros((1, command.shape[1])), np.cumsum(command, axis=0)])
        at = np.arange(first, last)
        parts.append((command[at + span] - command[at], answer[at + lag + span] - answer[at + lag]))
    return parts if parts and 2 * len(parts) >= len(pieces) else None


def _sums(parts: list[tuple[Array, Array]]) -> _Sums:
    with np.errstate(over="ignore", invalid="ignore"):
        return _Sums(
            both=np.stack([x.T @ y for x, y in parts]),
            told=np.stack([(x**2).sum(axis=0) for x, _ in parts])[:, :, None],
            seen=np.stack([(y**2).sum(axis=0) for _, y in parts])[:, None, :],
        )


def _votes(parts: list[tuple[Array, Array]], fixed: Array | None) -> Following:
    """The median episode's word on every pair, with one gain for all episodes."""
    own = _explained(_sums(parts), fixed)
    others = [x for x, _ in (*parts[1:], parts[0])]
    short = [min(len(x), len(y)) for x, (_, y) in zip(others, parts, strict=True)]
    swapped = [(x[:n], y[:n]) for n, x, (_, y) in zip(short, others, parts, strict=True)]
    chance = _explained(_sums(swapped), fixed)
    explained = np.nan_to_num(_median(own[0]), nan=-np.inf)
    left = [1.0 - _mean(np.clip(found[0], 0.0, 1.0)) for found in (own, chance)]
    beyond = (left[0] <= BEYOND_CHANCE * left[1]) | (explained >= CERTAIN)
    return Following(explained, np.nan_to_num(own[1], nan=1.0), beyond)


def _explained(sums: _Sums, fixed: Array | None) -> tuple[Array, Array]:
    """Share explained in each episode that has a vote (E, D_a, D_o), and the gain (D_a, D_o)."""
    commanded = sums.told > STILL * sums.told.mean(axis=0)
    moving = commanded | (sums.seen > STILL * sums.seen.mean(axis=0))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        slopes = np.where(commanded, sums.both / sums.told, np.nan)
        gain = _median(slopes) if fixed is None else fixed
        explained = _share(gain, sums.both, sums.told, sums.seen)
    return np.where(moving, explained, np.nan), gain


def _share(gain: Array, both: Array, told: Array, seen: Array) -> Array:
    """Share of both motions that the gain explains: 1 where they are one, at most."""
    asked = gain**2 * told
    return np.asarray((2.0 * gain * both - asked) / np.maximum(seen, asked))


def _mean(values: Array) -> Array:
    """Mean over the episodes that have a vote; 0 where none has."""
    known = np.isfinite(values)
    total = np.where(known, values, 0.0).sum(axis=0)
    return np.asarray(total / np.maximum(known.sum(axis=0), 1))


def _median(values: Array) -> Array:
    """Median over the episodes that have a vote; NaN where none has."""
    known = np.isfinite(values)
    filled = np.where(known, values, np.inf)
    order = np.sort(filled, axis=0)
    count = known.sum(axis=0)
    low = np.take_along_axis(order, np.maximum((count - 1) // 2, 0)[None], axis=0)[0]
    high = np.take_along_axis(order, np.minimum(count // 2, len(values) - 1)[None], axis=0)[0]
    with np.errstate(invalid="ignore"):
        return np.where(count > 0, 0.5 * (low + high), np.nan)
