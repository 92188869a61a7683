"""Do a candidate's chunks speak of the same metres as the recordings, and of what was observed?

For every recorded moment the candidate whose places lie nearest to what was done is taken, since
several ways may be right. Over moments of different episodes the recorded places are then a line of
the candidate's: slope 1 for the same unit, axis and sign, 0.001 for millimetres, -1 for a mirrored
axis, 10 for a spread that is ten times too small. A candidate that knows the moment is nearer to
what was done there than to what was done elsewhere; one that does not is as near to all.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION
from genpolicy.contract.rotation import angle_between, rotation_from_6d

Array = NDArray[np.float64]

AXES = ("x", "y", "z")
PERMUTATIONS = 9_999
DRAWS = 2_000
TAIL = 0.005
STANDS_STILL = 1e-6
"""A recorded number that moves less than this from moment to moment has no slope to compare."""
ROUNDING = 1e-12
"""What is left of a constant when its mean is taken off, in parts of it."""
COPIED_M = 2e-7
"""Rounding to float32, as on the wire; no network comes so near in every number of a chunk."""


@dataclass(frozen=True)
class Slope:
    """How much one recorded number moves as the candidate's moves by one.

    Attributes:
        name: `x`, `y`, `z` or `gripper`.
        slope: Least squares over moments; NaN where the candidate's does not move.
        low: Lower end of its interval.
        high: Upper end.
    """

    name: str
    slope: float
    low: float
    high: float


def nearest(candidates: Array, recorded: Array) -> Array:
    """Of each moment, the candidate chunk whose places lie nearest to the recorded ones.

    Args:
        candidates: Shape (M, N, K, 10), finite.
        recorded: Shape (M, K, 10).

    Returns:
        Shape (M, K, 10).
    """
    apart = candidates[..., POSITION] - recorded[:, None, :, POSITION]
    best = np.argmin((apart**2).sum(axis=(2, 3)), axis=1)
    chosen: Array = candidates[np.arange(len(candidates)), best]
    return chosen


def slopes(chunks: Array, recorded: Array, *, rng: np.random.Generator) -> list[Slope]:
    """Slope of each number that moves in the recordings, with a bootstrap over moments.

    Args:
        chunks: Shape (M, K, 10).
        recorded: Likewise.
        rng: For the bootstrap.
    """
    columns = [*range(POSITION.stop), GRIPPER]
    found = []
    for name, column in zip((*AXES, "gripper"), columns, strict=True):
        ours, theirs = recorded[..., column].mean(axis=1), chunks[..., column].mean(axis=1)
        if np.ptp(ours) <= STANDS_STILL:
            continue
        rows = rng.integers(len(ours), size=(DRAWS, len(ours)))
        drawn = _slope(theirs[rows], ours[rows])
        ends = (
            np.nanquantile(drawn, [TAIL, 1.0 - TAIL]) if not np.isnan(drawn).all() else [np.nan] * 2
        )
        found.append(
            Slope(name, float(_slope(theirs[None], ours[None])[0]), float(ends[0]), float(ends[1]))
        )
    return found


def _slope(theirs: Array, ours: Array) -> Array:
    """Of rows (draws, M); NaN where theirs stand still."""
    centred = theirs - theirs.mean(axis=1, keepdims=True)
    still = np.abs(centred).max(axis=1) <= ROUNDING * np.maximum(np.abs(theirs).max(axis=1), 1.0)
    spread = np.where(still, 0.0, (centred**2).sum(axis=1))
    covered = (centred * (ours - ours.mean(axis=1, keepdims=True))).sum(axis=1)
    slope: Array = np.full(len(spread), np.nan)
    np.divide(covered, spread, where=spread > 0.0, out=slope)
    return slope


def turned_away(chunks: Array, recorded: Array) -> tuple[int, int]:
    """At how many moments a chunk is turned farther from the recorded one than others are.

    Returns:
        That number, and the number of moments. Others are as far away as the recordings of nine
        in ten other moments are; where all are turned alike, `SMALL_TURN_RAD`.
    """
    ours = rotation_from_6d(recorded[:, 0, ROTATION])
    theirs = rotation_from_6d(chunks[:, 0, ROTATION])
    off = angle_between(ours, theirs)
    apart = np.stack([angle_between(np.broadcast_to(one, ours.shape), ours) for one in ours])
    usual = np.quantile(apart, 0.9, axis=1)
    return int(np.sum(~(off <= np.maximum(usual, SMALL_TURN_RAD)))), len(ours)


SMALL_TURN_RAD = 0.05
"""Three degrees: what a good policy may be off where all recordings are turned alike."""


def shuffled_share(candidates: Array, recorded: Array, *, rng: np.random.Generator) -> float:
    """Share of shuffles in which the chunks are as near to the recordings of other moments.

    At each moment the candidate nearest to the recording it is held against counts, its own or
    another's alike: taken by its own recording only, chance would favour it. Displacements from
    each chunk's first row are compared, in spreads of the recordings, so that a constant
    displacement from an observed pose knows nothing; single actions are compared as they are. A
    permutation test of "the chunks do not depend on the moment".

    Args:
        candidates: Shape (M, N, K, 10).
        recorded: Shape (M, K, 10).
        rng: For the shuffles.
    """
    moments, number = candidates.shape[:2]
    theirs = _motion(candidates.reshape(-1, *candidates.shape[2:]))
    ours = _motion(recorded)
    spread = ours.std(axis=0)
    moves = spread > STANDS_STILL
    if not moves.any():
        return 1.0
    theirs, ours = theirs[:, moves] / spread[moves], ours[:, moves] / spread[moves]
    apart = np.stack([
        np.sqrt(((theirs - one) ** 2).mean(axis=1)).reshape(moments, number).min(axis=1)
        for one in ours
    ], axis=1)  # fmt: skip
    own = np.trace(apart)
    rows = np.arange(moments)
    shuffled = rng.permuted(np.tile(rows, (PERMUTATIONS, 1)), axis=1)
    as_near = int(np.sum(apart[rows, shuffled].sum(axis=1) <= own * (1.0 + ROUNDING)))
    return float((1 + as_near) / (1 + PERMUTATIONS))


def _motion(chunks: Array) -> Array:
    moved = chunks - chunks[:, :1] if chunks.shape[1] > 1 else chunks
    return moved.reshape(len(chunks), -1)


def copied(candidates: Array, recorded: Array) -> int:
    """At how many moments a candidate is the recording itself."""
    same = np.abs(candidates - recorded[:, None]).max(axis=(2, 3)) <= COPIED_M
    return int(same.any(axis=1).sum())
