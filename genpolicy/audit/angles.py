"""Commanded angles that jump by a turn, and quaternions of either sign, without a jump.

A roll near half a turn is written +3.14 in one row and -3.14 in the next, and a rotation as q or
-q: one command, and two modes for whoever takes the numbers as places. A tool that points down is
recorded so everywhere.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
TURNS = (2.0 * np.pi, 360.0)  # rad, degrees
# A wrapped angle spans its turn, within this share, and steps either little or nearly by a turn.
TURN_TOLERANCE = 0.1
SMALL_STEP = 0.35
# An angle that stays at the seam of its turn has no value in the middle.
MIDDLE_SHARE = 0.3
# A hand that is told to open or to close has few values, and nothing between its ends.
MOST_FLAGS = 8
QUATERNION = 4
# Length of stored quaternions, interpolated ones included, and the share of rows that have it.
LENGTH_TOLERANCE, UNIT_SHARE = 0.02, 0.99


def without_jumps(values: Array, episode: Integers, columns: Integers) -> Array:
    """The same with angles and quaternions made continuous, each episode as the others.

    Args:
        values: Places. Shape (N, D).
        episode: Episode of each row; the rows of one stand together, in order. Shape (N,).
        columns: Columns that may be angles or parts of a quaternion, ascending.

    Returns:
        Shape (N, D); the very same array where nothing jumps.
    """
    result = values
    for column in columns.tolist():
        turn = turn_of(values[:, column], episode)
        if turn:
            result = values.copy() if result is values else result
            result[:, column] = _continuous(values[:, column], episode, turn)
    for part in _quaternions(values, columns):
        signs = _signs(values[:, part], episode)
        if np.any(signs < 0.0):
            result = values.copy() if result is values else result
            result[:, part] *= signs[:, None]
    return result


def turn_of(values: Array, episode: Integers) -> float:
    """The turn by which an angle jumps, in its unit; 0 where it is no angle, or does not jump.

    Args:
        values: Shape (N,).
        episode: Shape (N,).
    """
    if len(np.unique(values)) <= MOST_FLAGS:
        return 0.0
    steps = np.abs(np.diff(values))[np.diff(episode) == 0]
    span, low = float(np.ptp(values)), float(values.min())
    for turn in TURNS:
        if abs(span / turn - 1.0) > TURN_TOLERANCE:
            continue
        jump = steps > (1.0 - SMALL_STEP) * turn
        unclear = (steps > SMALL_STEP * turn) & ~jump
        at = (values - low) / span
        middle = (at > MIDDLE_SHARE) & (at < 1.0 - MIDDLE_SHARE)
        if not unclear.any() and (jump.any() or not middle.any()):
            return turn
    return 0.0


def _continuous(values: Array, episode: Integers, turn: float) -> Array:
    """Unwrapped inside episodes, whose beginnings lie within half a turn of the usual one."""
    edges = np.flatnonzero(np.diff(episode)) + 1
    parts = [np.unwrap(part, period=turn) for part in np.split(values, edges)]
    begins = np.array([part[0] for part in parts])
    usual = np.angle(np.exp(2j * np.pi * begins / turn).mean()) * turn / (2.0 * np.pi)
    return np.concatenate([p - turn * np.round((p[0] - usual) / turn) for p in parts])


def _quaternions(values: Array, columns: Integers) -> list[slice]:
    """Four neighbouring columns of length one that are no flags, from left to right."""
    found: list[slice] = []
    free = columns.tolist()
    while len(free) >= QUATERNION:
        part = slice(free[0], free[0] + QUATERNION)
        together = free[:QUATERNION] == list(range(part.start, part.stop))
        if together and _is_unit(values[:, part]):
            found.append(part)
            free = free[QUATERNION:]
        else:
            free = free[1:]
    return found


def _is_unit(values: Array) -> bool:
    length = np.sqrt((values**2).sum(axis=1))
    unit = np.mean(np.abs(length - 1.0) <= LENGTH_TOLERANCE) >= UNIT_SHARE
    return bool(unit) and len(np.unique(values)) > MOST_FLAGS


def _signs(quaternion: Array, episode: Integers) -> Array:
    """Signs under which no row is nearer to the negative of the one before. Shape (N,).

    Episodes begin on the side on which most of them begin.
    """
    first = np.flatnonzero(np.diff(episode, prepend=episode[0] - 1))
    turned = np.zeros(len(quaternion), dtype=np.int64)
    turned[1:] = (quaternion[1:] * quaternion[:-1]).sum(axis=1) < 0.0
    turned[first] = 0
    count = np.cumsum(turned)
    lengths = np.diff(np.append(first, len(quaternion)))
    inside = np.where((count - np.repeat(count[first], lengths)) % 2, -1.0, 1.0)
    begins = quaternion[first]
    usual = np.linalg.eigh(begins.T @ begins)[1][:, -1]
    side = np.where(begins @ usual < 0.0, -1.0, 1.0)
    side *= -1.0 if np.count_nonzero(side < 0.0) > len(side) / 2 else 1.0
    return np.asarray(inside * np.repeat(side, lengths), dtype=np.float64)
