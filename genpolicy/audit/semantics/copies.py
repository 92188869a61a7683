"""Copies: episodes recorded once and filed twice, and episodes glued to others or to themselves.

Rows in which nothing moves are left out first: all episodes may wait at one place, and a copy may
have lost its rests. Every window of a few of the others is a point; the windows of an episode are
looked up among all others in a tree, so the cost is n log n. Two stretches that meet at a window
are then compared row by row, both ways, as far as they agree: a copy agrees in the small movements
too, where two demonstrations of one way differ.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.middle import middle
from genpolicy.audit.semantics.meetings import may_cover
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.robust import episode_centred, episode_sums

WINDOW = 8
PROBES = 6
NEIGHBOURS = 6
LARGEST_WIDTH = 12
# So many probes tell the usual distance between two episodes.
PAIRED = 500
COMPONENTS = 6
# A copy's distance, as a share of the usual distance between two episodes at the same place.
CLOSE = 0.05
# A copy's difference in second differences, as a share of those of the episode.
SMALL_MOVEMENT = 0.2
# Differences up to this share of the usual distance are rounding.
ROUNDING = 1e-5
# Power of the steps of a difference over its own: 2 for noise, next to 0 for a smooth one.
ROUGH = 0.5
# Share of the rows of the shorter episode that a copy covers (two scripted ones share their begin);
# of an episode glued to itself, the share that comes again.
COVER = 0.7
SELF_COVER = 0.3
# Of rows that are the same bit by bit, so many in a row that no way passes twice, and their share.
EXACT_ROWS, EXACT_COVER = 4, 0.2
LEAST_OVERLAP = 12
# What changes in less than this share of the rows in which the liveliest column does, switches.
SWITCHES = 0.5
# A row whose step is below this share of the usual one repeats the row before.
REST_STEP = 1e-6


@dataclass(frozen=True)
class Copies:
    """Episodes that hold what another, or themselves, hold already.

    Attributes:
        duplicate: Shape (E,).
        of: The episode that a duplicate is a copy of, else -1. Shape (E,).
        repeats_itself: Shape (E,).
        joins: Rows at which the second copy begins in an episode that repeats itself.
    """

    duplicate: Flags
    of: Integers
    repeats_itself: Flags
    joins: set[int] = field(default_factory=set)


@dataclass(frozen=True)
class Moving:
    """The rows that move, closed up.

    Attributes:
        signal: Scaled columns in which copies are looked for. Shape (M, D).
        whole: All scaled columns that move, in which a copy must agree. Shape (M, W).
        rows: Their rows. Shape (M,).
        starts: First of each episode, and their number. Shape (E + 1,).
        usual: Usual distance between two episodes, in `whole`.
        covered: Rows of each pair of episodes that agree, as stretches.
    """

    signal: Array
    whole: Array
    rows: Integers
    starts: Integers
    usual: float = 0.0
    covered: dict[tuple[int, int], list[tuple[int, int]]] = field(default_factory=dict)


def find_copies(data: AuditInput, motion: Motion) -> Copies:
    """Duplicates (up to a time offset, a cut, rests, tiny noise) and self-repeating episodes."""
    count = len(motion.starts) - 1
    result = Copies(np.zeros(count, bool), np.full(count, -1), np.zeros(count, bool))
    every = _signals(data, motion)
    if every is None:
        return result
    moving = _moving(*every, motion)
    _repeats(result, moving)
    places, segment = _windows(moving.starts)
    if len(places) < NEIGHBOURS + 1:
        return result
    points = _points(moving.signal, places)
    probes = _probes(moving, places)
    tree = cKDTree(points)
    nearest = tree.query(points[probes], k=NEIGHBOURS)
    distance, found = np.asarray(nearest[0]), np.asarray(nearest[1])
    some = probes[:: max(1, len(probes) // PAIRED)]
    near = CLOSE * _usual_distance(points[some], segment[some])
    usual = _usual_distance(_points(moving.whole, places[some]), segment[some])
    moving = replace(moving, usual=usual)
    number, place = np.nonzero(distance <= near)
    probe, other = probes[number], found[number, place]
    rows = places[np.sort(np.stack([probe, other], axis=1)[probe != other], axis=1)]
    hopeful = may_cover(
        moving.signal, moving.starts, rows, near=near, least=LEAST_OVERLAP, own=SELF_COVER, of=COVER
    )
    for row, later in rows[hopeful].tolist():
        _judge(result, moving, row, later)
    return result


def _signals(data: AuditInput, motion: Motion) -> tuple[Array, Array] | None:
    """Scaled columns that move inside episodes, action and observation: some (N, D), all (N, W)."""
    columns = np.concatenate([data.action, data.observation], axis=1)
    length = np.maximum(np.diff(motion.starts), 1)[:, None]
    inside = episode_centred(columns, motion.starts)
    power = np.sqrt(np.median(episode_sums(inside**2, motion.starts) / length, axis=0))
    total = np.std(columns, axis=0)
    moving = np.flatnonzero(power > 0.05 * np.where(total > 0, total, np.inf))
    if len(moving) == 0:
        return None
    # Looked for is in those of many that move most for their range, and in what only switches now
    # and then last. They alone say no copy: of one operator gripper, phase and height may be as
    # alike on two sides of what stands in the way.
    stirs = (np.diff(columns[:, moving], axis=0) != 0).mean(axis=0)
    switches = stirs < SWITCHES * stirs.max()
    chosen = np.sort(np.lexsort((-(power[moving] / total[moving]), switches))[:LARGEST_WIDTH])
    whole = np.asarray(columns[:, moving] / power[moving])
    return whole[:, chosen], whole


def _moving(signal: Array, whole: Array, motion: Motion) -> Moving:
    """The rows in which something moves; the first of each episode is one."""
    steps = np.linalg.norm(np.diff(signal, axis=0, prepend=signal[:1]), axis=1)
    first = motion.starts[:-1][np.diff(motion.starts) > 0]
    steps[first] = 0.0
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    kept = steps > REST_STEP * usual
    kept[first] = True
    counts = np.concatenate([[0], np.cumsum(kept)])
    rows = np.flatnonzero(kept)
    starts = np.asarray(counts[motion.starts], dtype=np.int64)
    return Moving(signal[rows], whole[rows], rows, starts)


def _repeats(result: Copies, moving: Moving) -> None:
    """Episodes of which some moving rows come again bit by bit, whatever was cut out between."""
    total = len(moving.rows)
    if total < EXACT_ROWS:
        return
    # One number stands for a row: equal rows have equal ones, and others hardly ever.
    weights = np.sqrt(np.arange(2, moving.signal.shape[1] + 2))
    rows = (moving.signal * weights).sum(axis=1)
    keys = np.zeros(total - EXACT_ROWS + 1)
    for offset in range(EXACT_ROWS):
        keys += np.sqrt(3.0 + offset) * rows[offset : offset + len(keys)]
    segment = np.repeat(np.arange(len(moving.starts) - 1), np.diff(moving.starts))
    inside = np.flatnonzero(segment[: len(keys)] == segment[EXACT_ROWS - 1 :])
    order = inside[np.lexsort((inside, keys[inside], segment[inside]))]
    same = segment[order[1:]] == segment[order[:-1]]
    again = order[1:][same & (keys[order[1:]] == keys[order[:-1]])]
    count = np.bincount(segment[again], minlength=len(moving.starts) - 1)
    length = np.diff(moving.starts)
    found = (count >= LEAST_OVERLAP) & (count - EXACT_COVER * length >= 0)
    result.repeats_itself[found] = True
    later = np.sort(again[found[segment[again]]])
    _, first = np.unique(segment[later], return_index=True)
    result.joins.update(moving.rows[later[first]].tolist())


def _windows(starts: Integers) -> tuple[Integers, Integers]:
    """First row of every window inside an episode, and its episode."""
    rows = np.arange(starts[-1])
    segment = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    fits = rows + WINDOW <= starts[1:][segment]
    return rows[fits], segment[fits]


def _points(signal: Array, places: Integers) -> Array:
    """Windows as points of few numbers: the principal ones of their rows at even steps."""
    offsets = np.arange(0, WINDOW, 2)
    wide = np.concatenate([signal[places + offset] for offset in offsets], axis=1)
    wide -= wide.mean(axis=0)
    if wide.shape[1] <= COMPONENTS:
        return wide
    _, vectors = np.linalg.eigh(wide.T @ wide)
    return np.asarray(wide @ vectors[:, -COMPONENTS:])


def _probes(moving: Moving, places: Integers) -> Integers:
    """Windows of each episode at which it moves: at even shares of its path."""
    signal = moving.signal
    steps = np.linalg.norm(np.diff(signal, axis=0, prepend=signal[:1]), axis=1)
    probes = []
    for first, last in zip(moving.starts[:-1], moving.starts[1:], strict=True):
        if last - first < WINDOW + 2:
            continue
        path = np.cumsum(steps[first + 1 : last])
        if path[-1] <= 0:
            continue
        shares = (np.arange(PROBES) + 0.5) / PROBES * path[-1]
        rows = first + np.searchsorted(path, shares) - WINDOW // 2
        probes += np.unique(np.clip(rows, first, last - WINDOW)).tolist()
    return np.searchsorted(places, np.asarray(probes, dtype=np.int64))


def _usual_distance(points: Array, segment: Integers) -> float:
    """Median distance between windows of different episodes."""
    other = pdist(segment[:, None].astype(np.float64)) > 0.0
    return float(np.median(pdist(points)[other])) if other.any() else 0.0


def _judge(result: Copies, moving: Moving, row: int, other: int) -> None:
    """Compare two episodes, or one with itself, from a common window on, both ways."""
    row, other = min(row, other), max(row, other)
    starts = moving.starts
    a = int(np.searchsorted(starts, row, side="right")) - 1
    b = int(np.searchsorted(starts, other, side="right")) - 1
    if a == b and other - row < LEAST_OVERLAP:
        return
    back = min(row - int(starts[a]), other - int(starts[b]))
    on = min(int(starts[a + 1]) - row, int(starts[b + 1]) - other)
    first, second = moving.whole[row - back : row + on], moving.whole[other - back : other + on]
    apart = np.linalg.norm(first - second, axis=1) > CLOSE * moving.usual
    before, after = np.flatnonzero(apart[:back]), np.flatnonzero(apart[back:])
    begin = int(before[-1]) + 1 if len(before) else 0
    end = back + int(after[0]) if len(after) else len(apart)
    if end - begin < LEAST_OVERLAP or not _same(first[begin:end], second[begin:end], moving.usual):
        return
    # A copy without its rests agrees in several stretches, each at another distance.
    later = other - back
    stretches = moving.covered.setdefault((a, b), [])
    stretches.append((later + begin, later + end))
    covered = _union(stretches)
    length = np.diff(starts)
    needed = SELF_COVER * length[a] if a == b else COVER * min(length[a], length[b])
    if covered - needed < 0:
        return
    if a == b:
        result.repeats_itself[a] = True
        result.joins.add(int(moving.rows[min(first for first, _ in stretches)]))
    else:
        result.duplicate[b], result.of[b] = True, a


def _union(stretches: list[tuple[int, int]]) -> int:
    """Rows in any of the stretches."""
    total, reached = 0, -1
    for first, last in sorted(stretches):
        total += max(0, last - max(first, reached))
        reached = max(reached, last)
    return total


def _same(first: Array, second: Array, usual: float) -> bool:
    """Whether two stretches agree in place and in their small movements.

    What is left between a copy and its original is rounding or noise; between two smooth ways that
    lie close it is smooth itself.
    """
    gap = first - second
    if not CLOSE * usual - float(np.sqrt((gap**2).sum(axis=1).mean())) >= 0:
        return False
    if float(np.abs(gap).max()) <= ROUNDING * usual:
        return True
    steps = gap[1:] - gap[:-1]
    rough = float((steps**2).sum()) / max(float((gap**2).sum()), 1e-300)
    if not rough - ROUGH >= 0:
        return False
    left = steps[1:] - steps[:-1]
    small = first[1:] - first[:-1]
    small = small[1:] - small[:-1]
    power = (small**2).sum(axis=0)
    # What is the same to the bit, as a phase or a schedule, may be so in two demonstrations.
    noisy = (power > 0) & (left != 0).any(axis=0)
    if not noisy.any():
        return True
    share = np.sqrt((left**2).sum(axis=0)[noisy] / power[noisy])
    return bool(middle(share) <= SMALL_MOVEMENT)
