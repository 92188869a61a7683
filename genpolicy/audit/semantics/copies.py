"""Copies: episodes recorded once and filed twice, and episodes glued to others or to themselves.

Every window of a few rows is a point; the windows of an episode at which it moves are looked up
among all others in a tree, so the cost is n log n. Two stretches that meet at a window are then
compared row by row for as long as both last: a copy agrees in the small movements too, where two
demonstrations of one way differ.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from genpolicy.audit.data import Array, AuditInput, Flags, Integers, Text
from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.report import listed
from genpolicy.audit.semantics.robust import episode_centred, episode_sums, some
from genpolicy.audit.settings import AuditSettings

WINDOW = 8
PROBES = 4
NEIGHBOURS = 6
LARGEST_WIDTH = 12
COMPONENTS = 6
# A copy's distance, as a share of the usual distance between two episodes at the same place.
CLOSE = 0.05
# A copy's difference in second differences, as a share of those of the episode.
SMALL_MOVEMENT = 0.2
# Share of the shorter episode that a copy covers; of an episode glued to itself, its half.
COVER = 0.5
SELF_COVER = 0.4
LEAST_OVERLAP = 12


@dataclass(frozen=True)
class Copies:
    """Episodes that hold what another, or themselves, hold already; masks of shape (E,)."""

    duplicate: Flags
    of: Integers
    repeats_itself: Flags


def find_copies(data: AuditInput, motion: Motion) -> Copies:
    """Duplicated episodes (up to a time offset, a cut, tiny noise) and self-repeating ones."""
    count = len(motion.starts) - 1
    result = Copies(np.zeros(count, bool), np.full(count, -1), np.zeros(count, bool))
    signal = _signal(data, motion)
    if signal is None:
        return result
    places, segment = _windows(motion)
    if len(places) < NEIGHBOURS + 1:
        return result
    points = _points(signal, places)
    probes = _probes(signal, motion, places)
    tree = cKDTree(points)
    nearest = tree.query(points[probes], k=NEIGHBOURS)
    distance, found = np.asarray(nearest[0]), np.asarray(nearest[1])
    usual = _usual_distance(points, segment, probes)
    for number, probe in enumerate(probes):
        for near, other in zip(distance[number], found[number], strict=True):
            if near > CLOSE * usual or other == probe:
                continue
            _judge(result, signal, motion, (int(places[probe]), int(places[other])), usual=usual)
    return result


def copy_findings(copies: Copies, data: AuditInput, settings: AuditSettings) -> list[Finding]:
    """Duplicates and self-repeating episodes as findings."""
    names, total = data.episodes.uuid, len(data.episodes)
    findings = []
    if some(copies.duplicate, total, settings.outlier_share):
        pairs = [
            f"{names[k]} of {names[copies.of[k]]}" for k in np.flatnonzero(copies.duplicate)[:3]
        ]
        count = int(copies.duplicate.sum())
        findings.append(
            Finding(
                kind="duplicate",
                variable="episode",
                where=listed(names[copies.duplicate]),
                question="faulty_episodes_share",
                measured=count / total,
                floor=settings.outlier_share,
                unit="share",
                action=f"{count} of {total} episodes are copies of others ({'; '.join(pairs)}): "
                "keep one of each and repeat the audit.",
            )
        )
    if some(copies.repeats_itself, total, settings.outlier_share):
        count = int(copies.repeats_itself.sum())
        findings.append(
            _glued(names[copies.repeats_itself], count, total, settings, "hold the same rows twice")
        )
    return findings


def splice_findings(data: AuditInput, motion: Motion, settings: AuditSettings) -> list[Finding]:
    """Episodes that jump in their middle as no motion of this data set does."""
    total = len(motion.starts) - 1
    jumps = np.zeros(total, dtype=bool)
    jumps[motion.segment[np.setdiff1d(motion.pieces[:-1], motion.starts)]] = True
    if not some(jumps, total, settings.outlier_share):
        return []
    names = data.episodes.uuid[jumps]
    return [_glued(names, int(jumps.sum()), total, settings, "jump in their middle")]


def _glued(names: Text, count: int, total: int, settings: AuditSettings, what: str) -> Finding:
    return Finding(
        kind="glued",
        variable="episode",
        where=listed(names),
        question="faulty_episodes_share",
        measured=count / total,
        floor=settings.outlier_share,
        unit="share",
        action=f"{count} of {total} episodes {what} ({listed(names)}): several recordings were "
        "joined. Split them where they meet and repeat the audit.",
    )


def _signal(data: AuditInput, motion: Motion) -> Array | None:
    """Scaled columns that move inside episodes, action and observation. Shape (N, D)."""
    columns = np.concatenate([data.action, data.observation], axis=1)
    length = np.maximum(np.diff(motion.starts), 1)[:, None]
    inside = episode_centred(columns, motion.starts)
    power = np.sqrt(np.median(episode_sums(inside**2, motion.starts) / length, axis=0))
    total = np.std(columns, axis=0)
    moving = np.flatnonzero(power > 0.05 * np.where(total > 0, total, np.inf))
    if len(moving) == 0:
        return None
    # Of many columns those that move most for their range; all of them say the same of a copy.
    order = np.argsort(-(power[moving] / total[moving]), kind="stable")[:LARGEST_WIDTH]
    chosen = np.sort(moving[order])
    return np.asarray(columns[:, chosen] / power[chosen])


def _windows(motion: Motion) -> tuple[Integers, Integers]:
    """First row of every window inside an episode, and its episode."""
    rows = np.arange(motion.starts[-1])
    segment = motion.segment
    fits = rows + WINDOW <= motion.starts[1:][segment]
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


def _probes(signal: Array, motion: Motion, places: Integers) -> Integers:
    """Windows of each episode at which it moves: at even shares of its path."""
    steps = np.linalg.norm(np.diff(signal, axis=0, prepend=signal[:1]), axis=1)
    probes = []
    for first, last in zip(motion.starts[:-1], motion.starts[1:], strict=True):
        if last - first < WINDOW + 2:
            continue
        path = np.cumsum(steps[first + 1 : last])
        if path[-1] <= 0:
            continue
        shares = (np.arange(PROBES) + 0.5) / PROBES * path[-1]
        rows = first + np.searchsorted(path, shares) - WINDOW // 2
        probes += np.unique(np.clip(rows, first, last - WINDOW)).tolist()
    return np.searchsorted(places, np.asarray(probes, dtype=np.int64))


def _usual_distance(points: Array, segment: Integers, probes: Integers) -> float:
    """Median distance between windows of different episodes, at probes."""
    step = max(1, len(probes) // 500)
    chosen = probes[::step]
    gaps = points[chosen][:, None, :] - points[chosen][None, :, :]
    distance = np.linalg.norm(gaps, axis=2)
    other = segment[chosen][:, None] != segment[chosen][None, :]
    return float(np.median(distance[other])) if other.any() else 0.0


def _judge(
    result: Copies, signal: Array, motion: Motion, rows: tuple[int, int], *, usual: float
) -> None:
    """Compare two episodes, or one with itself, from a common window on, both ways."""
    row, other = rows
    a = int(np.searchsorted(motion.starts, row, side="right")) - 1
    b = int(np.searchsorted(motion.starts, other, side="right")) - 1
    if a == b and abs(row - other) < LEAST_OVERLAP:
        return
    back = min(row - motion.starts[a], other - motion.starts[b])
    on = min(motion.starts[a + 1] - row, motion.starts[b + 1] - other)
    first, second = signal[row - back : row + on], signal[other - back : other + on]
    length = np.diff(motion.starts)
    cover = SELF_COVER * length[a] if a == b else COVER * min(length[a], length[b])
    if len(first) < max(LEAST_OVERLAP, cover) or not _same(first, second, usual):
        return
    if a == b:
        result.repeats_itself[a] = True
    else:
        later, kept = max(a, b), min(a, b)
        result.duplicate[later], result.of[later] = True, kept


def _same(first: Array, second: Array, usual: float) -> bool:
    """Whether two stretches agree in place and in their small movements."""
    gap = first - second
    if not CLOSE * usual - float(np.sqrt((gap**2).sum(axis=1).mean())) >= 0:
        return False
    small, left = np.diff(first, n=2, axis=0), np.diff(gap, n=2, axis=0)
    power = (small**2).sum(axis=0)
    noisy = power > 0
    if not noisy.any():
        return True
    share = np.sqrt((left**2).sum(axis=0)[noisy] / power[noisy])
    return bool(np.median(share) <= SMALL_MOVEMENT)
