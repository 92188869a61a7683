"""Rows in which the arm is told to stand: to wait is no part of the way.

All rows of one rest show one observation, and what follows is the same however long it took. So of
a rest only the last row, from which the arm leaves, is a situation to compare.
"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers

# A step below this share of the usual one is none.
STANDS = 0.1


def leaving(data: AuditInput) -> Flags:
    """Rows that move the arm, and the last one before each; all where nothing ever moves.

    Args:
        data: Canonical audit input.

    Returns:
        Shape (N,).
    """
    steps = _steps(data)
    moving = steps[steps > 0.0]
    if not len(moving):
        return np.ones(len(steps), dtype=bool)
    goes = steps - STANDS * float(np.median(moving)) >= 0
    ahead = np.minimum(np.arange(len(goes)) + 1, data.last_row)
    return np.asarray(goes | goes[ahead])


def rank_of(data: AuditInput, chosen: Flags) -> Integers:
    """How many chosen rows of its episode lie before each row. Shape (N,)."""
    before: Integers = np.cumsum(chosen) - chosen
    return np.asarray(before - before[data.first_row], dtype=np.int64)


def _steps(data: AuditInput) -> Array:
    """How far each row's command moves what it commands; of places, until the next one. (N,)."""
    columns = np.arange(data.action.shape[1])[data.action_position]
    places = data.action[:, columns]
    ahead = np.minimum(np.arange(len(places)) + 1, data.last_row)
    steps = places[ahead] - places
    # The last place of an episode goes nowhere: it is like the one before.
    steps[data.last_row] = places[data.last_row] - places[np.maximum(data.last_row - 1, 0)]
    if data.forms is not None:
        added = data.forms.added[columns]
        steps = np.where(added, places, steps) * data.forms.gain[columns]
    return np.asarray(np.linalg.norm(steps, axis=1))
