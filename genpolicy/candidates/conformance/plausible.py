"""Do a candidate's chunks speak of the same metres as the recordings, and of what was observed?

For every recorded moment the candidate whose places lie nearest to what was done is taken, since
several ways may be right. Over moments of different episodes the recorded numbers are then a line
of the candidate's: slope 1 for the same unit, axis and sign, 0.001 for millimetres, -1 for a
mirrored axis or a transposed rotation, 10 for a spread that is ten times too small. A candidate
that knows the moment is nearer to what was done there than to what was done elsewhere; one that
does not is as near to all.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation as Turn

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION
from genpolicy.contract.rotation import rotation_from_6d

Array = NDArray[np.float64]

AXES = ("x", "y", "z")
PERMUTATIONS = 9_999
DRAWS = 2_000
TAIL = 0.005
STANDS_M = 1e-3
"""What a place or an opening moves at least from moment to moment to be compared: ten times the
repeatability of the arms that this is for (0.1 mm by ISO 9283, data sheet of the Franka Emika
Panda), twice the position resolution of a usual gripper (0.4 mm, Robotiq 2F-85)."""
STANDS_RAD = 1e-2
"""The same of a turn: a place that moves so far at a lever of 0.1 m."""
FEWEST = 20
"""Moments below which nothing is said of units: a slope of few is anything."""
NOTHING = 1e-6
"""A number of a chunk that differs less from moment to moment is rounding, in m or of a column."""
ROUNDING = 1e-12
"""What is left of a constant when its mean is taken off, in parts of it."""
COPIED_M = 2e-7
"""Rounding to float32, as on the wire; no network comes so near in every number of a chunk."""


@dataclass(frozen=True)
class Slope:
    """How much one recorded number moves as the candidate's moves by one.

    Both sides hold noise: least squares of one on the other are too flat. The true factor lies
    between that slope and the inverse of the slope the other way round (Frisch 1934), so the
    interval goes from the lower end of the first to the upper end of the second.

    Attributes:
        name: `x`, `y`, `z`, `gripper`, a place at the start, or `turn` about an axis.
        slope: Recorded on candidate, least squares over moments; NaN where the candidate's does
            not move.
        low: Lower end of the factor.
        high: Upper end; both are infinite where the two may have nothing to do with each other.
        stands: The candidate's moves less than `STANDS_M` or `STANDS_RAD`, at the upper end, where
            the recorded one moves more than three times as much, at the lower end.
    """

    name: str
    slope: float
    low: float
    high: float
    stands: bool


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
    """Slope of each place and of the opening, where it moves in the recordings.

    Args:
        chunks: Shape (M, K, 10).
        recorded: Likewise.
        rng: For the bootstrap over moments.
    """
    columns = [*range(POSITION.stop), GRIPPER]
    theirs, ours = chunks[..., columns].mean(axis=1), recorded[..., columns].mean(axis=1)
    rows = rng.integers(len(ours), size=(DRAWS, len(ours)))
    return _compared((*AXES, "gripper"), theirs, ours, STANDS_M, rows)


def start_slopes(
    candidates: Array, measured: Array, episodes: NDArray[np.str_], *, rng: np.random.Generator
) -> list[Slope]:
    """Slope of where the robot is on where chunks begin, axis by axis.

    An arm begins where it stands, whichever way it takes: of two mirrored ways the recorded one may
    be either, and says nothing of a mirrored axis; the place that it begins at does.

    Args:
        candidates: Shape (M, N, K, 10). The median over N is taken.
        measured: Where the robot was; NaN where the observation does not say. Shape (M, 10).
        episodes: Of each moment, all with as many. Shape (M,).
        rng: For the bootstrap over episodes.
    """
    begun, stood = np.median(candidates[:, :, 0, POSITION], axis=1), measured[:, POSITION]
    if not np.isfinite(stood).all():
        return []
    names = tuple(f"{axis} at the start" for axis in AXES)
    # One that commands a goal far ahead from its first action on stands, and is not another unit.
    compared = _compared(names, begun, stood, STANDS_M, of_episodes(episodes, rng))
    return [replace(one, stands=False) for one in compared]


def of_episodes(episodes: NDArray[np.str_], rng: np.random.Generator) -> NDArray[np.int64]:
    """Draws of as many episodes as there are, each with all its moments. Shape (DRAWS, M).

    What a candidate answers at moments of one episode is alike, as what was observed there is: the
    episode is the unit, and more moments of it are a better look at one unit.

    Args:
        episodes: Of each moment, all with as many. Shape (M,).
        rng: Draws.
    """
    _, begins, of = np.unique(episodes, return_index=True, return_inverse=True)
    members = np.argsort(begins[of], kind="stable").reshape(len(begins), -1)
    drawn: NDArray[np.int64] = members[rng.integers(len(members), size=(DRAWS, len(members)))]
    return drawn.reshape(DRAWS, -1)


def turn_slopes(chunks: Array, recorded: Array, *, rng: np.random.Generator) -> list[Slope]:
    """Slope of the turn of a chunk's first action about each axis of the recordings' mean one.

    Args:
        chunks: Shape (M, K, 10).
        recorded: Likewise.
        rng: For the bootstrap over moments.
    """
    first = [rotation_from_6d(of[:, 0, ROTATION]) for of in (chunks, recorded)]
    whole = ~np.isnan(first[0]).any(axis=(1, 2)) & ~np.isnan(first[1]).any(axis=(1, 2))
    if whole.sum() < FEWEST:
        return []
    theirs, ours = (Turn.from_matrix(of[whole]) for of in first)
    back = ours.mean().inv()
    names = tuple(f"turn about {axis}" for axis in AXES)
    turns = (back * theirs).as_rotvec(), (back * ours).as_rotvec()
    rows = rng.integers(len(turns[0]), size=(DRAWS, len(turns[0])))
    return _compared(names, *turns, STANDS_RAD, rows)


def _compared(
    names: tuple[str, ...], theirs: Array, ours: Array, stands: float, rows: NDArray[np.int64]
) -> list[Slope]:
    """Of numbers (M, C), those of which the recordings move at the worse end of draws of rows."""
    found = []
    for column, name in enumerate(names):
        drawn = _moments(theirs[rows, column], ours[rows, column])
        moved = np.sqrt(np.quantile(drawn.ours, TAIL))
        if moved <= stands:
            continue
        one = _moments(theirs[None, :, column], ours[None, :, column])
        with np.errstate(divide="ignore", invalid="ignore"):
            alike = drawn.both / np.sqrt(drawn.ours * drawn.theirs)
            flat, steep = drawn.both / drawn.theirs, drawn.ours / drawn.both
            slope = float((one.both / one.theirs)[0])
        still = np.sqrt(np.quantile(drawn.theirs, 1.0 - TAIL)) <= stands
        low, high = _between(alike, flat, steep)
        found.append(
            Slope(
                name, slope if np.isfinite(slope) else np.nan, low, high,
                stands=bool(still and moved > STANDS_APART * stands),
            )
        )  # fmt: skip
    return found


STANDS_APART = 3.0
"""A candidate that stands is told from one that moves little by the factor of another scale."""


def _between(alike: Array, flat: Array, steep: Array) -> tuple[float, float]:
    """Ends of a factor, of draws of the correlation and of both slopes.

    A draw in which the candidate stands says nothing, so that nothing is known.
    """
    if np.isnan(alike).any():
        return -np.inf, np.inf
    if np.quantile(alike, TAIL) > 0.0:
        return float(np.quantile(flat, TAIL)), float(np.quantile(steep, 1.0 - TAIL))
    if np.quantile(alike, 1.0 - TAIL) < 0.0:
        return float(np.quantile(steep, TAIL)), float(np.quantile(flat, 1.0 - TAIL))
    return -np.inf, np.inf


@dataclass(frozen=True)
class _Moments:
    """Variances of draws, and what is common; 0 where a number is the same but for rounding."""

    theirs: Array
    ours: Array
    both: Array


def _moments(theirs: Array, ours: Array) -> _Moments:
    """Of rows (draws, M)."""
    centred, wanted = (_centred(of) for of in (theirs, ours))
    return _Moments(
        (centred**2).mean(axis=1), (wanted**2).mean(axis=1), (centred * wanted).mean(axis=1)
    )


def _centred(values: Array) -> Array:
    centred = values - values.mean(axis=1, keepdims=True)
    still = np.abs(centred).max(axis=1) <= ROUNDING * np.maximum(np.abs(values).max(axis=1), 1.0)
    kept: Array = np.where(still[:, None], 0.0, centred)
    return kept


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
    moves = spread > NOTHING
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
