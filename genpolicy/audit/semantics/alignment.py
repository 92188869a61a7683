"""Columns that trail the others by their build are brought together before lags are measured."""

from dataclasses import replace

import numpy as np

from genpolicy.audit.data import Array
from genpolicy.audit.semantics.following import Following
from genpolicy.audit.semantics.lags import segment_lags
from genpolicy.audit.semantics.motion import Motion

# Columns whose lags differ by less are not aligned, steps.
LEAST_ALIGNED = 2
# Episodes in which the lag of each column is measured.
ALIGNED_EPISODES = 40


def aligned(motion: Motion, follows: Following, maximum_rows: int) -> Motion:
    """The same with the commands of each column later by what its joint trails the others.

    A hand that closes slowly trails an arm by several rows in every episode: that is its build and
    no clock, and the lag of an episode must not depend on which of both moved more.
    """
    # Against the episode's own lag, in which a fault of its clock counts for all columns.
    coarse = _middles(np.where(follows.follows, follows.lag - follows.common_lag[:, None], np.nan))
    if not np.any(np.abs(coarse) >= LEAST_ALIGNED):
        return motion
    # These lags go in steps of some rows: one step is no difference until it is measured.
    fine = _column_lags(motion, maximum_rows)
    behind = _middles(fine - _middles(fine.T)[:, None])
    rows = np.where(np.abs(coarse) >= LEAST_ALIGNED, np.round(behind), 0.0).astype(np.int64)
    rows[np.abs(rows) < LEAST_ALIGNED] = 0
    if not rows.any():
        return motion
    first = np.repeat(motion.starts[:-1], np.diff(motion.starts))
    last = np.repeat(motion.starts[1:], np.diff(motion.starts)) - 1
    commanded = motion.commanded.copy()
    for column in np.flatnonzero(rows):
        at = np.clip(np.arange(len(commanded)) - rows[column], first, last)
        commanded[:, column] = motion.commanded[at, column]
    return replace(motion, commanded=commanded)


def _column_lags(motion: Motion, maximum_rows: int) -> Array:
    """Lag of each column by itself in some episodes, evenly drawn; NaN where it is not known.

    Returns:
        Shape (episodes, P).
    """
    places = np.linspace(0, len(motion.starts) - 2, min(len(motion.starts) - 1, ALIGNED_EPISODES))
    chosen = [slice(*motion.starts[place : place + 2]) for place in places.astype(int)]
    starts = np.cumsum([0, *(part.stop - part.start for part in chosen)])
    asked, seen = (
        np.concatenate([values[part] for part in chosen])
        for values in (motion.commanded, motion.observed)
    )
    return np.stack(
        [
            segment_lags(asked[:, [column]], seen[:, [column]], starts, maximum_rows).steps
            for column in range(asked.shape[1])
        ],
        axis=1,
    )


def _middles(values: Array) -> Array:
    """Median of what is known in each column; 0 where nothing is. Shape (P,)."""
    return np.array(
        [np.median(c[np.isfinite(c)]) if np.isfinite(c).any() else 0.0 for c in values.T]
    )
