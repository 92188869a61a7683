"""The commanded and the observed motion of every episode, ready to be held against each other."""

from dataclasses import dataclass

import numpy as np

from genpolicy.audit.angles import SMALL_STEP, TURN_TOLERANCE, TURNS
from genpolicy.audit.data import Array, AuditInput, Flags, Integers, Text
from genpolicy.audit.semantics.directions import directional, one_sign
from genpolicy.audit.semantics.robust import episode_medians

# A splice is a step this many times as large as the fast steps of all motion, and as its
# neighbours: a fast motion is fast in its neighbours too.
SPLICE_STEP = 5.0


@dataclass(frozen=True)
class Motion:
    """Paired motion; without a pair both have no columns.

    Attributes:
        commanded: Shape (N, P), angles unwrapped.
        observed: Shape (N, P), angles unwrapped.
        names: Name of each component.
        starts: First row of each episode, and the number of rows. Shape (E + 1,).
        pieces: The same, with the splices at which command and response jump together. A jump
            looks like a response without lag.
        epoch: Calibration epoch of each episode. Shape (E,).
        wraps: Jumps by a whole turn that were taken out.
        directional: Columns of length one together, which have no unit. Shape (P,).
    """

    commanded: Array
    observed: Array
    names: tuple[str, ...]
    starts: Integers
    pieces: Integers
    epoch: Text
    wraps: int
    directional: Flags

    @property
    def segment(self) -> Integers:
        """Episode of each row. Shape (N,)."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))


def make_motion(data: AuditInput) -> Motion:
    """The motion in canonical data."""
    starts = np.searchsorted(data.episode, np.arange(len(data.episodes) + 1))
    columns = np.arange(data.observation.shape[1])[data.observation_position]
    if not data.paired:
        columns = columns[:0]
    # What is a change or a rate, added up: gains, lags and frames can be asked of it as well.
    commanded = np.array(data.commanded if data.paired else data.action[:, :0], dtype=np.float64)
    observed = np.array(data.observation[:, columns], dtype=np.float64)
    inside = data.episode[1:] == data.episode[:-1]
    wraps = 0
    for component in range(len(columns)):
        turned = 0.0
        for values in (commanded, observed):
            values[:, component], found, turn = _unwrapped(
                values[:, component], inside, data.episode
            )
            wraps, turned = wraps + found, max(turned, turn)
        if turned:
            gap = commanded[:, component] - observed[:, component]
            observed[:, component] += turned * np.round(_repeated_medians(gap, starts) / turned)
    one_sign(commanded, observed, np.asarray(starts, dtype=np.int64))
    return Motion(
        commanded=commanded,
        observed=observed,
        names=tuple(data.observation_names[column] for column in columns),
        starts=np.asarray(starts, dtype=np.int64),
        pieces=_pieces(commanded, observed, data.episode, starts),
        epoch=data.episodes.calibration_epoch,
        wraps=wraps,
        directional=directional(observed) | directional(commanded),
    )


def _unwrapped(values: Array, inside: Flags, episode: Integers) -> tuple[Array, int, float]:
    """The angle without jumps by a turn inside an episode, how many there were, and the turn."""
    steps = np.where(inside, np.diff(values), 0.0)
    for turn in TURNS:
        jump = np.abs(steps) > (1.0 - SMALL_STEP) * turn
        spans = abs(float(np.ptp(values)) / turn - 1.0) <= TURN_TOLERANCE
        unclear = (np.abs(steps) > SMALL_STEP * turn) & ~jump
        if not spans or not jump.any() or unclear.any():
            continue
        turns = np.concatenate([[0.0], np.cumsum(np.where(jump, -np.sign(steps) * turn, 0.0))])
        first = np.searchsorted(episode, episode)
        return values + turns - turns[first], int(np.count_nonzero(jump)), turn
    return values, 0, 0.0


def _pieces(commanded: Array, observed: Array, episode: Integers, starts: Integers) -> Integers:
    """First rows of the pieces without a splice, and the number of rows."""
    inside = episode[1:] == episode[:-1]
    splice = np.full(len(inside), commanded.shape[1] > 0)
    for values in (commanded, observed):
        scale = np.std(values, axis=0)
        scaled = values / np.where(scale > 0, scale, np.inf)
        steps = np.where(inside, np.linalg.norm(np.diff(scaled, axis=0), axis=1), 0.0)
        moving = steps[inside & (steps > 0)]
        usual = float(np.quantile(moving, 0.95)) if len(moving) else np.inf
        beside = np.maximum(np.append(0.0, steps[:-1]), np.append(steps[1:], 0.0))
        splice &= (steps > SPLICE_STEP * usual) & (steps > SPLICE_STEP * beside)
    return np.union1d(starts, np.flatnonzero(splice) + 1).astype(np.int64)


def _repeated_medians(values: Array, starts: Integers) -> Array:
    """Median of each episode, at each of its rows. Shape (N,)."""
    return np.asarray(np.repeat(np.nan_to_num(episode_medians(values, starts)), np.diff(starts)))
