"""Offsets in a part of the episodes: calibrations of which no epoch tells.

In some episodes the observed position stands beside its command by a constant, in the others it
does not. What else parts episodes so is no calibration: stiffness, a load and what is touched
depend on where the arm is or on which way it took, and a lag on how fast it moves. So the offset
must be there in every part of the way, at both ends too, in a column that follows its command all
the while; at least one part must be too slow for a lag; and episodes that went alike must stand on
both sides.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from genpolicy.audit.data import Array, AuditInput, Flags, Integers, recorded
from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.calibration import offset_floor
from genpolicy.audit.semantics.clocks import LEAST_EPISODES, two_clusters
from genpolicy.audit.semantics.following import Following
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.report import listed
from genpolicy.audit.settings import AuditSettings

# A column that follows its command in fewer episodes stands, or is held by something.
FOLLOWED = 0.5
# Rows that count: the slower ones, where a lag that is not quite the usual one shows least.
SLOWER = 0.5
LEAST_ROWS = 3
# Parts of the way by what is travelled. A load is taken up, a spring pulled and a thing touched on
# the way: at both ends little of that is so, and an offset is.
PARTS = ((0.0, 0.05), (0.0, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 1.0), (0.95, 1.0))
# In each of them it is as large as in all, within this share of it.
CONSTANT = 0.3
# Lags are known to some rows; what a column moves in so many may be one.
LAG_ROWS = 4.0
# Ways are held against each other at so many places, each against so many of its like.
PLACES, ALIKE = 8, 3
# If likes are on one side beyond this share, the offset is a matter of what they are like in.
TOLD = 0.5
# Words of what was carried or mounted, or of how stiff the arm was: another arm, no other unit. Who
# was there, and when, tells of calibrations.
CARRIED = {
    *("load", "payload", "mass", "weight", "tool", "gripper", "finger", "fingers", "object"),
    *("material", "stiffness", "compliance", "impedance", "damping", "gain", "gains", "kp", "kd"),
}
WORDS = re.compile("[a-z]+")


@dataclass(frozen=True)
class _Beside:
    """Followed columns beside their commands of a usual lag ago.

    Attributes:
        columns: Which columns of the motion. Shape (C,).
        gap: Observed minus commanded. Shape (N, C).
        speed: How far the command of each column moves to the next row. Shape (N, C).
        pace: How far all of them move, in their spreads. Shape (N,).
        starts: First row of each episode, and the number of rows. Shape (E + 1,).
    """

    columns: Integers
    gap: Array
    speed: Array
    pace: Array
    starts: Integers

    def slower(self, rows: Integers) -> Integers:
        """The slower ones of some rows."""
        order = np.argsort(self.pace[rows], kind="stable")
        return np.asarray(rows[order[: max(LEAST_ROWS, int(SLOWER * len(rows)))]])

    def offsets(self) -> Array:
        """Median gap of the slower rows of each episode; NaN of a short one. Shape (E, C)."""
        result = np.full((len(self.starts) - 1, self.gap.shape[1]), np.nan)
        for number, (a, b) in enumerate(pairwise(self.starts)):
            if b - a >= LEAST_ROWS:
                result[number] = np.median(self.gap[self.slower(np.arange(a, b))], axis=0)
        return result


def part_findings(
    data: AuditInput, motion: Motion, follows: Following, settings: AuditSettings
) -> list[Finding]:
    """Some episodes in which a column stands beside its command as in no others.

    Args:
        data: Canonical data.
        motion: Commanded and observed motion, as recorded.
        follows: How each column follows its command.
        settings: Limits.
    """
    beside = _beside(data, motion, follows)
    if len(beside.columns) == 0:
        return []
    known = follows.follows[:, beside.columns]
    offsets = np.where(known, beside.offsets(), np.nan)
    floor = offset_floor(motion, settings)
    worst: tuple[float, int, Flags, Flags] | None = None
    for place in range(len(beside.columns)):
        chosen, gaps = two_clusters(offsets[:, place], floor)
        if not chosen.any():
            continue
        size, others = abs(float(np.median(gaps[chosen]))), np.isfinite(gaps) & ~chosen
        if (worst is None or size > worst[0]) and _everywhere(beside, place, chosen, others):
            worst = size, place, chosen, others
    if worst is None or explained(data, motion, worst[2], worst[3]):
        return []
    size, place, chosen, _ = worst
    return [_finding(data, motion.names[beside.columns[place]], chosen, size, floor)]


def _beside(data: AuditInput, motion: Motion, follows: Following) -> _Beside:
    """Columns commanded as places that follow in most episodes, beside their commands."""
    enough = np.count_nonzero(follows.follows, axis=0) >= max(
        2 * LEAST_EPISODES, FOLLOWED * len(follows.follows)
    )
    enough &= ~motion.directional
    enough &= ~added(data, len(enough))  # begins where it is seen: an offset of either is lost
    columns, lengths = np.flatnonzero(enough), np.diff(motion.starts)
    first, last = (np.repeat(ends, lengths) for ends in (motion.starts[:-1], motion.starts[1:] - 1))
    asked = np.empty((len(first), len(columns)))
    for place, column in enumerate(columns):
        usual = float(np.median(follows.lag[follows.follows[:, column], column]))
        rows = np.clip(np.arange(len(first)) - round(usual), first, last)
        asked[:, place] = motion.commanded[rows, column]
    seen = motion.observed[:, columns]
    return _Beside(
        columns=np.asarray(columns, dtype=np.int64),
        gap=seen - asked,
        speed=np.abs(_changes(asked, motion.starts)),
        pace=_pace(asked, motion.starts) + _pace(seen, motion.starts),
        starts=motion.starts,
    )


def added(data: AuditInput, width: int) -> Flags:
    """Columns of the motion whose commands are changes or rates, added up. Shape (P,)."""
    if data.forms is None or not data.paired:
        return np.zeros(width, dtype=bool)
    places = np.arange(data.action.shape[1])[data.action_position]
    return np.asarray(data.forms.added[places])


def _everywhere(beside: _Beside, place: int, chosen: Flags, others: Flags) -> bool:
    """Whether the offset is there in all parts of the way, and no lag in one of them."""
    gaps, speeds = (np.full((len(chosen), len(PARTS)), np.nan) for _ in range(2))
    for number in np.flatnonzero(chosen | others):
        a, b = beside.starts[number : number + 2]
        way = along(beside.pace[a:b])
        for k, (begin, end) in enumerate(PARTS):
            rows = np.flatnonzero((way >= begin) & (way <= end))
            if len(rows) < LEAST_ROWS:
                every = np.arange(b - a)
                rows = every[:LEAST_ROWS] if end < 0.5 else every[-LEAST_ROWS:]
            chosen_rows = beside.slower(a + rows)
            gaps[number, k] = np.median(beside.gap[chosen_rows, place])
            speeds[number, k] = np.median(beside.speed[chosen_rows, place])
    apart = np.median(gaps[chosen], axis=0) - np.median(gaps[others], axis=0)
    usual = float(np.median(apart))
    if not np.all(CONSTANT * abs(usual) - np.abs(apart - usual) >= 0):
        return False
    moved = np.maximum(*(np.median(speeds[side], axis=0) for side in (chosen, others)))
    return bool(np.any(np.abs(apart) - LAG_ROWS * moved >= 0))


def explained(
    data: AuditInput, motion: Motion, chosen: Flags, others: Flags, *, paced: bool = False
) -> bool:
    """Whether the way tells which episodes are chosen, or what was carried.

    Args:
        data: Canonical data.
        motion: Commanded and observed motion, as recorded.
        chosen: Episodes of one side. Shape (E,).
        others: Those of the other. Shape (E,).
        paced: Whether how long they took may tell as well.
    """
    known = np.flatnonzero(chosen | others)
    objects, own = data.episodes.object[known], chosen[known]
    # A shift of the one leaves the other where it was: ways are alike as commanded or as seen.
    ways = (_routes(values, motion.starts)[known] for values in (motion.commanded, motion.observed))
    if min(_told(_nearest(routes), own) for routes in ways) > TOLD:
        return True
    lasted = np.diff(motion.starts)[known].astype(np.float64)[:, None]
    if paced and _told(_nearest(lasted), own) > TOLD:
        return True
    said: list[NDArray[Any]] = [objects] if recorded(objects) else []
    said += [
        item.values[known]
        for item in data.variables
        if not item.by_row and CARRIED & {*WORDS.findall(item.name.lower())}
    ]
    return any(_told(_same(values), own) > TOLD for values in said)


def _same(values: NDArray[Any]) -> Iterator[Integers]:
    """Those of the same value as each, without itself."""
    for number, value in enumerate(values):
        same = np.flatnonzero(values == value)
        yield np.asarray(same[same != number], dtype=np.int64)


def _told(alike: Iterable[Integers], chosen: Flags) -> float:
    """By how much more of their likes are chosen of those who are than of the others.

    1 where likes are never on both sides, about 0 where being alike says nothing.
    """
    shares = np.array([np.mean(chosen[near]) if len(near) else np.nan for near in alike])
    known = np.isfinite(shares)
    if not (known & chosen).any() or not (known & ~chosen).any():
        return 0.0
    return float(np.mean(shares[known & chosen]) - np.mean(shares[known & ~chosen]))


def _nearest(places: Array) -> Iterator[Integers]:
    """Those nearest to each, without itself."""
    near = np.asarray(cKDTree(places).query(places, k=min(ALIKE + 1, len(places)))[1])
    for number, row in enumerate(near):
        yield np.asarray(row[row != number][:ALIKE], dtype=np.int64)


def _routes(values: Array, starts: Integers) -> Array:
    """Where each episode was at equal shares of its way, in spreads. Shape (E, PLACES * P)."""
    scale = np.std(values, axis=0)
    scaled, pace = values / np.where(scale > 0, scale, np.inf), _pace(values, starts)
    result = np.zeros((len(starts) - 1, PLACES * values.shape[1]))
    for number, (a, b) in enumerate(pairwise(starts)):
        if b > a:
            rows = np.searchsorted(along(pace[a:b]), np.linspace(0.0, 1.0, PLACES))
            result[number] = scaled[a:b][rows.clip(max=b - a - 1)].ravel()
    return result


def along(pace: Array) -> Array:
    """Share of the way that lies behind each row. Shape (n,)."""
    behind = np.cumsum(pace)
    return np.asarray(behind / behind[-1] if behind[-1] > 0 else np.linspace(0, 1, len(pace)))


def _pace(values: Array, starts: Integers) -> Array:
    """How far each row lies from the one before in its episode, in spreads. Shape (N,)."""
    scale = np.std(values, axis=0)
    changes = _changes(values, starts) / np.where(scale > 0, scale, np.inf)
    return np.asarray(np.linalg.norm(changes, axis=1))


def _changes(values: Array, starts: Integers) -> Array:
    """Changes from the row before in its episode, 0 at its first. Shape (N, C)."""
    changes = np.diff(values, axis=0, prepend=values[:1])
    changes[starts[:-1][np.diff(starts) > 0]] = 0.0
    return np.asarray(changes)


def _finding(data: AuditInput, name: str, chosen: Flags, size: float, floor: float) -> Finding:
    names = data.episodes.uuid[chosen]
    return Finding(
        kind="calibration",
        variable=name,
        where=listed(names),
        question="calibration_residual_m",
        measured=size,
        floor=floor,
        unit="unit of the position",
        action=f"In {len(names)} of {len(chosen)} episodes ({listed(names)}) the observed {name} "
        f"stands {size:.4g} (unit of the position) further from its command than in the others, "
        "all along ways that others took too: recalibrate them or leave them out, and repeat the "
        "audit.",
    )
