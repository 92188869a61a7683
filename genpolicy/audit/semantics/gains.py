"""Factors in a part of the episodes: another scale of commands, of which no epoch tells.

In some episodes the arm goes by another factor of what it is told than in the others. That is also
what a spring, a load, a fast hand and a finger that is stopped do, which depend on where the arm
is, on which way it took, on what it carries or holds and on how fast it moves. So most columns must
be apart by one factor, in both halves of the way, and episodes that went alike, and as fast, must
stand on both sides. Rates are not asked: a controller that clips them does the same.
"""

from itertools import pairwise

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.clocks import LEAST_EPISODES, two_clusters
from genpolicy.audit.semantics.following import Following
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.offsets import added, along, explained
from genpolicy.audit.semantics.report import listed
from genpolicy.audit.semantics.robust import episode_sums
from genpolicy.audit.semantics.units import LIKE, log_gain
from genpolicy.audit.settings import AuditSettings

# Less is what a faster motion of the same arm falls short by.
LEAST_FACTOR = 1.25
# In each half of the way it is as large as in all, within this share of its logarithm.
CONSTANT = 0.35
# Share of the columns that must be apart by one factor, for it to be the position's.
MOST = 0.5


def part_gain_findings(
    data: AuditInput, motion: Motion, found: Following, asked: Flags, settings: AuditSettings
) -> list[Finding]:
    """Some episodes in which a column answers by another factor than in the others.

    Args:
        data: Canonical data.
        motion: Commanded and observed motion, as recorded.
        found: How each column follows its command.
        asked: Columns that move beside the others and have a unit. Shape (P,).
        settings: Limits.
    """
    asked = asked & ~added(data, len(asked))
    alike = np.maximum(found.positive, found.negative) >= LIKE
    least = np.log(max(LEAST_FACTOR, settings.gain_epoch_floor))
    gains = np.where(alike, log_gain(found.seen, found.asked), np.nan)
    halves = _of_halves(motion, found)
    worst: tuple[float, Flags, Flags] | None = None
    for column in np.flatnonzero(asked):
        if np.count_nonzero(np.isfinite(gains[:, column])) < 2 * LEAST_EPISODES:
            continue
        chosen, gaps = two_clusters(gains[:, column], least)
        others = np.isfinite(gaps) & ~chosen
        if not chosen.any() or not _constant(halves[:, :, column], chosen, others):
            continue
        size = float(np.median(gaps[chosen]))
        if worst is None or abs(size) > abs(worst[0]):
            worst = size, chosen, others
    if worst is None:
        return []
    size, chosen, others = worst
    if not _shared(gains[:, asked], size, chosen, others):
        return []
    if explained(data, motion, chosen, others, paced=True):
        return []
    return [_finding(data, chosen, size, float(np.exp(least)))]


def _shared(gains: Array, size: float, chosen: Flags, others: Flags) -> bool:
    """Whether most columns, and more than one, are apart by much the same factor.

    One alone may be a finger that is stopped by what it holds, of two widths.
    """
    known = np.isfinite(gains)
    enough = [np.count_nonzero(known & side[:, None], axis=0) for side in (chosen, others)]
    told = np.minimum(*enough) >= LEAST_EPISODES
    if np.count_nonzero(told) < 2:
        return False
    apart = np.nanmedian(gains[chosen][:, told], axis=0)
    apart -= np.nanmedian(gains[others][:, told], axis=0)
    same = CONSTANT * abs(size) - np.abs(apart - size) >= 0
    return bool(np.count_nonzero(same) >= max(2, MOST * len(same)))


def _of_halves(motion: Motion, found: Following) -> Array:
    """Logarithm of each column's factor in both halves of the way of all. Shape (2, E, P)."""
    first = _first_half(found.moves[0], motion.starts)[:, None]
    powers = [moves**2 for moves in found.moves]
    sums = (
        [episode_sums(half * power, motion.starts) for power in powers] for half in (first, ~first)
    )
    return np.stack([log_gain(seen, asked) / 2.0 for asked, seen in sums])


def _first_half(moves: Array, starts: Integers) -> Flags:
    """Rows up to where half of the commanded motion lies behind, in spreads. Shape (N,)."""
    scale = np.std(moves, axis=0)
    pace = np.linalg.norm(moves / np.where(scale > 0, scale, np.inf), axis=1)
    return np.concatenate([along(pace[a:b]) <= 0.5 for a, b in pairwise(starts)])


def _constant(halves: Array, chosen: Flags, others: Flags) -> bool:
    """Whether both halves of the way are apart by much the same factor. Halves: (2, E)."""
    apart = []
    for half in halves:
        sides = [half[side & np.isfinite(half)] for side in (chosen, others)]
        if min(map(len, sides)) < LEAST_EPISODES:
            return False
        apart.append(float(np.median(sides[0]) - np.median(sides[1])))
    usual = sum(apart) / len(apart)
    return all(CONSTANT * abs(usual) - abs(one - usual) >= 0 for one in apart)


def _finding(data: AuditInput, chosen: Flags, size: float, floor: float) -> Finding:
    names, factor = data.episodes.uuid[chosen], float(np.exp(abs(size)))
    side = "more" if size > 0 else "less"
    return Finding(
        kind="unit",
        variable="position",
        where=listed(names),
        question="gain_epoch_factor",
        measured=factor,
        floor=floor,
        unit="factor",
        action=f"In {len(names)} of {len(chosen)} episodes ({listed(names)}) the position moves by "
        f"a factor of {factor:.4g} {side} of what it is told than in the others, all along ways "
        "that others took too, as fast: bring the commands to one scale or leave those out, and "
        "repeat the audit.",
    )
