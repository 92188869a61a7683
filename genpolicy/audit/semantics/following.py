"""How each observed column follows its own command, episode by episode and column by column.

What is correlated are displacements between the means of two neighbouring spans of rows, at every
shift: slow motion, in which a tremor hardly counts and which two joints that end at one place do
not share by that alone. Nothing here is pooled, neither over columns nor over episodes, so that a
fault in some of them widens no scale by which it is judged.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from genpolicy.audit.data import Array, Flags, Integers
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.robust import episode_sums

# Length of each span: a tremor of 5 Hz and more averages out, s; and its bounds, rows.
SPAN_S = 0.3
LEAST_SPAN, LARGEST_SPAN = 2, 15
# Fewer displacements of an episode say nothing.
LEAST_ROWS = 10
# Motion is slow if its displacements between means are this large a share of those between rows.
SLOW_SHARE = 0.5
# Correlation with which a column follows a command...
FOLLOWS = 0.8


@dataclass(frozen=True)
class Following:
    """Shapes (E, P); NaN where an episode is too short or a column stands.

    Attributes:
        positive: Largest correlation with the command over all shifts.
        negative: Largest correlation with the negative of the command.
        asked: Root mean square of the commanded displacements.
        seen: The same of the observed ones.
        slow: Whether slow motion makes most of both.
        lag: Shift of the larger of both correlations, rows.
        independent: Displacements of each episode that share no row. Shape (E,).
        moves: Displacements, commanded and observed, 0 where there are none. Shape (N, P).
    """

    positive: Array
    negative: Array
    asked: Array
    seen: Array
    slow: Flags
    lag: Integers
    independent: Array
    moves: tuple[Array, Array]

    @property
    def follows(self) -> Flags:
        """Columns that follow their command, whatever the sign and the size. Shape (E, P)."""
        return np.nan_to_num(np.maximum(self.positive, self.negative)) >= FOLLOWS

    @property
    def common_lag(self) -> Integers:
        """Median shift of the columns that follow in each episode; of all where none does."""
        known = np.where(self.follows, self.lag.astype(np.float64), np.nan)
        usual = float(np.nanmedian(known)) if np.isfinite(known).any() else 0.0
        result = np.full(len(known), usual)
        some = np.isfinite(known).any(axis=1)
        result[some] = np.nanmedian(known[some], axis=1)
        return np.asarray(np.round(result), dtype=np.int64)


def following(motion: Motion, period_s: float, maximum_rows: int) -> Following:
    """How each column follows its command.

    Args:
        motion: Commanded and observed motion.
        period_s: Time between rows, s.
        maximum_rows: Largest shift, both ways, rows.
    """
    span = int(np.clip(round(SPAN_S / period_s), LEAST_SPAN, LARGEST_SPAN))
    x, x_slow = _moves(motion.commanded, motion.pieces, span, motion.starts)
    y, y_slow = _moves(motion.observed, motion.pieces, span, motion.starts)
    starts = motion.starts
    rows = np.maximum(np.diff(starts) - 2 * span, 0)[:, None]
    shape = (len(starts) - 1, x.shape[1])
    highest, lowest = np.full(shape, -np.inf), np.full(shape, np.inf)
    at_high, at_low = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    power_x, power_y = _running(x), _running(y)
    # Means of a span change little over a part of it.
    stride = max(1, span // 3)
    reach = stride * -(-maximum_rows // stride)
    for shift in range(-reach, reach + 1, stride):
        value = _correlation(x, y, (power_x, power_y), starts, shift)
        value[np.broadcast_to(rows - abs(shift) < LEAST_ROWS, shape)] = np.nan
        with np.errstate(invalid="ignore"):
            higher, lower = value > highest, value < lowest
        highest[higher], at_high[higher] = value[higher], shift
        lowest[lower], at_low[lower] = value[lower], shift
    known = np.isfinite(highest)
    count = np.maximum(rows, 1)
    return Following(
        positive=np.where(known, highest, np.nan),
        negative=np.where(known, -lowest, np.nan),
        asked=np.sqrt(episode_sums(x**2, starts) / count),
        seen=np.sqrt(episode_sums(y**2, starts) / count),
        slow=x_slow & y_slow,
        lag=np.where(highest >= -lowest, at_high, at_low),
        independent=np.asarray(rows[:, 0] / span),
        moves=(x, y),
    )


def column_correlations(found: Following, starts: Integers) -> Array:
    """Correlation of observed column i with the command of j, at the lag of each episode.

    Returns:
        Shape (E, P, P).
    """
    x, y = found.moves
    lags, width = found.common_lag, x.shape[1]
    result = np.zeros((len(starts) - 1, width, width))
    for number, (first, last) in enumerate(pairwise(starts)):
        late = int(lags[number])
        if last - first - abs(late) < LEAST_ROWS:
            continue
        asked = x[first + max(-late, 0) : last - max(late, 0)]
        seen = y[first + max(late, 0) : last - max(-late, 0)]
        power = np.sqrt((seen**2).sum(axis=0))[:, None] * np.sqrt((asked**2).sum(axis=0))
        result[number] = (seen.T @ asked) / np.where(power > 0, power, np.inf)
    return result


def _moves(values: Array, pieces: Integers, span: int, starts: Integers) -> tuple[Array, Flags]:
    """Displacements between neighbouring means, 0 at the ends of pieces; and whether they are slow.

    Returns:
        Shape (N, P), and by episode and column. Shape (E, P).
    """
    total = len(values)
    first = np.repeat(pieces[:-1], np.diff(pieces))
    last = np.repeat(pieces[1:], np.diff(pieces))
    at = np.arange(total)
    valid = (at - span >= first) & (at + span <= last)
    inner = at[valid]
    # Sums of what is left of one value of each piece: long sums of large numbers lose digits.
    running = np.zeros((total + 1, values.shape[1]))
    np.cumsum(values - values[first], axis=0, out=running[1:])
    moves = np.zeros_like(values)
    moves[inner] = (running[inner + span] - 2.0 * running[inner] + running[inner - span]) / span
    plain = np.zeros_like(values)
    half = span // 2
    plain[inner] = values[inner + half] - values[inner + half - span]
    slow = episode_sums(moves**2, starts) >= SLOW_SHARE**2 * episode_sums(plain**2, starts)
    # What a sum leaves of a constant is no motion.
    level = 1e-12 * np.abs(values).max(axis=0, initial=0.0)
    moves[np.abs(moves) <= level] = 0.0
    return moves, np.asarray(slow)


def _running(values: Array) -> Array:
    """Sums of squares of all rows before. Shape (N + 1, P)."""
    result = np.zeros((len(values) + 1, values.shape[1]))
    np.cumsum(values**2, axis=0, out=result[1:])
    return result


def _correlation(
    x: Array, y: Array, powers: tuple[Array, Array], starts: Integers, shift: int
) -> Array:
    """Correlation of y, later by a shift, with x over the rows that both have. Shape (E, P)."""
    size = len(x) - abs(shift)
    if size <= 0:
        return np.full((len(starts) - 1, x.shape[1]), np.nan)
    lead, trail = max(-shift, 0), max(shift, 0)
    product = np.zeros((len(x) + 1, x.shape[1]))
    np.multiply(x[lead : lead + size], y[trail : trail + size], out=product[lead : lead + size])
    first = np.minimum(starts[:-1] + lead, starts[1:])
    last = np.maximum(starts[1:] - trail, first)
    sums = np.add.reduceat(product, np.stack([first, last], axis=1).ravel(), axis=0)[::2]
    cross = np.where((last > first)[:, None], sums, 0.0)
    then, until = np.clip(first + shift, 0, len(x)), np.clip(last + shift, 0, len(x))
    power = np.maximum(powers[0][last] - powers[0][first], 0.0)
    both = np.sqrt(power * np.maximum(powers[1][until] - powers[1][then], 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(both > 0, cross / both, np.nan))
