"""Directions: neighbouring columns that together have length one, and so no unit.

Quaternions, direction cosines, the cosine and sine of an angle, columns of a rotation matrix. Their
scale is fixed; nothing in them can be in another unit. A quaternion and its negative are the same
rotation, and drivers change between them on the way: both signs are made one before motions are
compared.
"""

import numpy as np

from genpolicy.audit.data import Array, Flags, Integers
from genpolicy.audit.semantics.robust import episode_sums

WIDTHS = (2, 3, 4)
QUATERNION = 4
# Lengths of stored directions: rounding for most rows, interpolation for the others.
USUAL_LENGTH, LARGEST_LENGTH, MOST_ROWS = 1e-3, 2e-2, 0.99
# Of two readings the more exact is taken; beyond rounding both are alike, and the narrower is.
EXACT_DIGITS = 6
# Rows that are looked at, about.
LARGEST_SAMPLE = 50_000
# Columns that never change by this are no direction: a flag of one beside a zero has length one.
LEAST_RANGE = 1e-2


def blocks(values: Array) -> tuple[slice, ...]:
    """Runs of columns of length one, from left to right; of several readings the most exact.

    Args:
        values: Shape (N, D).
    """
    found: list[slice] = []
    if len(values) == 0:
        return ()
    values = values[:: max(1, len(values) // LARGEST_SAMPLE)]
    square = values**2
    spans = np.ptp(values, axis=0) > LEAST_RANGE
    first = 0
    while first < values.shape[1]:
        fits = []
        for width in WIDTHS:
            part = slice(first, first + width)
            within = part.stop <= values.shape[1] and bool(spans[first])
            if within and np.count_nonzero(spans[part]) >= 2:
                off = _off_length(square[:, part])
                if off <= USUAL_LENGTH:
                    fits.append((round(off, EXACT_DIGITS), width))
        if fits:
            width = min(fits)[1]
            found.append(slice(first, first + width))
            first += width
        else:
            first += 1
    return tuple(found)


def directional(values: Array) -> Flags:
    """Which columns belong to a direction. Shape (D,)."""
    result = np.zeros(values.shape[1], dtype=bool)
    for part in blocks(values):
        result[part] = True
    return result


def one_sign(commanded: Array, observed: Array, starts: Integers) -> None:
    """Make quaternions continuous in each episode, and commands agree with observations; in place.

    Args:
        commanded: Shape (N, P).
        observed: Shape (N, P).
        starts: First row of each episode, and the number of rows. Shape (E + 1,).
    """
    for part in blocks(observed):
        if part.stop - part.start != QUATERNION:
            continue
        if not USUAL_LENGTH - _off_length(commanded[:, part] ** 2) >= 0:
            continue
        for values in (commanded, observed):
            values[:, part] *= _continuous(values[:, part], starts)[:, None]
        together = episode_sums((commanded[:, part] * observed[:, part]).sum(axis=1), starts)
        commanded[:, part] *= np.repeat(np.where(together < 0, -1.0, 1.0), np.diff(starts))[:, None]


def _continuous(quaternion: Array, starts: Integers) -> Array:
    """Signs under which no row is nearer to the negative of the row before. Shape (N,)."""
    turned = np.zeros(len(quaternion), dtype=np.int64)
    turned[1:] = (quaternion[1:] * quaternion[:-1]).sum(axis=1) < 0
    turned[starts[:-1][starts[:-1] < len(turned)]] = 0
    count = np.cumsum(turned)
    first = starts[:-1][np.diff(starts) > 0]
    length = np.diff(starts)[np.diff(starts) > 0]
    return np.where((count - np.repeat(count[first], length)) % 2, -1.0, 1.0)


def _off_length(square: Array) -> float:
    """How far the usual row is from length one; infinite where some are far."""
    off = np.abs(np.sqrt(square.sum(axis=1)) - 1.0)
    near = np.count_nonzero(off <= LARGEST_LENGTH) >= MOST_ROWS * len(off)
    return float(np.median(off)) if near else np.inf
