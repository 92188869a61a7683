"""Clocks of streams whose channels move with the arm: by their lag behind its motion.

What a channel shows of the motion is unknown: a linear map from the observed position, the same for
all episodes, is fitted at the lag that fits best. A stream that the position does not explain says
nothing about its clock here; its receive delay still does.
"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Integers
from genpolicy.audit.semantics.lags import Lags, episode_lags
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.robust import episode_centred
from genpolicy.audit.settings import AuditSettings

LARGEST_SAMPLE = 20_000
# Share of a channel's motion that the position must explain.
EXPLAINED = 0.6
# Motion inside episodes below this share of all differences is noise of a thing that stands.
MOVING_SHARE = 0.05


def stream_lags(
    data: AuditInput, motion: Motion, columns: Integers, settings: AuditSettings
) -> Lags | None:
    """Lag of a stream's columns behind the observed position, by episode; None if unknown."""
    leading = episode_centred(motion.observed, motion.starts)
    trailing = episode_centred(data.observation[:, columns], motion.starts)
    if leading.shape[1] == 0 or len(columns) == 0:
        return None
    total = np.std(data.observation[:, columns], axis=0)
    inside = np.std(trailing, axis=0)
    # White noise differs from row to row as much as over an episode.
    steps = np.mean(np.diff(trailing, axis=0) ** 2, axis=0)
    moving = (inside > MOVING_SHARE * total) & (steps < inside**2) & (inside > 0)
    if not moving.any():
        return None
    trailing = trailing[:, moving]
    mapped = _mapped(leading, trailing, motion, settings.maximum_lag_rows)
    if mapped is None:
        return None
    shown, followed = mapped
    return episode_lags(
        shown, trailing[:, followed], motion.starts, motion.pieces, settings.maximum_lag_rows
    )


def _mapped(
    leading: Array, trailing: Array, motion: Motion, maximum_rows: int
) -> tuple[Array, Integers] | None:
    """The position as the channels show it, for those that it explains."""
    segment = motion.segment
    rows = np.arange(len(leading))
    rows = rows[:: max(1, len(rows) // LARGEST_SAMPLE)]
    best: tuple[float, Array, Array] | None = None
    for shift in range(-maximum_rows, maximum_rows + 1):
        at = rows[(rows + shift >= 0) & (rows + shift < len(leading))]
        at = at[segment[at] == segment[at + shift]]
        x, y = leading[at], trailing[at + shift]
        power = (y**2).sum(axis=0)
        gram = x.T @ x
        gram += 1e-9 * max(float(np.trace(gram)), 1e-300) * np.eye(len(gram))
        fit = np.linalg.solve(gram, x.T @ y)
        left = ((y - x @ fit) ** 2).sum(axis=0) / np.where(power > 0, power, np.inf)
        if best is None or left.mean() < best[0]:
            best = (float(left.mean()), fit, left)
    assert best is not None
    followed = np.flatnonzero(best[2] <= 1.0 - EXPLAINED)
    if len(followed) == 0:
        return None
    return np.asarray(leading @ best[1][:, followed]), followed
