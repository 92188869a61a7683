"""Frames: does the observed motion go where the commanded motion goes?

The displacement over a few rows, at the lag that fits best, is held against the commanded one:
columns that answer another column's command are swapped; a motion that is the commanded one turned
or mirrored stands in another frame. Both must be said by either half of the episodes alone.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.crossed import crossed_findings
from genpolicy.audit.semantics.following import Following
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.report import listed
from genpolicy.audit.semantics.robust import densest_half, episode_sums, some
from genpolicy.audit.settings import AuditSettings

LEAST_EPISODES = 6
# Displacements are taken over this many rows: beyond noise, within the turns of a path.
SPAN_ROWS = 6
LARGEST_SAMPLE = 20_000
# Correlation with which a column must follow the command that it answers...
FOLLOWS = 0.7
# ...and share of the unexplained motion that the other reading must leave.
BETTER = 0.5
# A turned motion must leave at most this share of what is left by gains without a turn.
TURN_BETTER = 0.6
# How far two halves may disagree about a turn, as a share of it.
HALVES = 0.35
CARTESIAN = (2, 3)
# Fractions of a row by which the best whole lag may be off.
FRACTIONS = (-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6)
# An episode follows badly beyond this share of unexplained motion, and this many spreads.
ODD_SHARE = 0.1
ODD_SPREADS = 6.0


@dataclass(frozen=True)
class Frame:
    """How one group of episodes answers its commands.

    Attributes:
        swapped: For each column the column whose command it answers. Shape (P,).
        turn: Rotation or mirroring of the motion, identity where there is none. Shape (P, P).
        angle_rad: Angle of the turn.
        kind: `swapped_columns`, `frame` or empty.
    """

    swapped: Integers
    turn: Array
    angle_rad: float
    kind: str


@dataclass(frozen=True)
class Displacements:
    """Displacements of some episodes: commanded, and observed later by a lag and `FRACTIONS`.

    Attributes:
        x: Commanded. Shape (n, P).
        y: Observed. Shape (fractions, n, P).
        group: Number of the episode of each. Shape (n,).
    """

    x: Array
    y: Array
    group: Integers

    def of(self, chosen: Flags) -> "Displacements":
        """Those that are chosen."""
        return Displacements(self.x[chosen], self.y[:, chosen], self.group[chosen])


def frame_findings(
    data: AuditInput, motion: Motion, follows: Following, settings: AuditSettings
) -> tuple[list[Finding], Array]:
    """Swapped columns and turned frames by epoch, and in a part of the episodes.

    Returns:
        Findings, and the commanded motion as it is answered, so that clocks can be measured in
        spite of them. Shape (N, P).
    """
    width = motion.commanded.shape[1]
    commanded = motion.commanded
    findings: list[Finding] = []
    if width == 0:
        return findings, commanded
    commanded = commanded.copy()
    clean = np.zeros(len(motion.epoch), dtype=bool)
    for name in np.unique(motion.epoch):
        episodes = np.flatnonzero(motion.epoch == name)
        enough = len(episodes) >= LEAST_EPISODES and width >= 2
        found = _frame(motion, episodes, settings) if enough else None
        clean[episodes] = found is None or not found.kind
        if found is None:
            continue
        # A turn within the limit is taken out too: in a bend it would be taken for a lag.
        _answer(commanded, motion, episodes, found)
        if not found.kind:
            continue
        where = f"epoch {name or '-'}"
        findings.append(_finding(data, motion, where, found, settings))
    # A part of an epoch, column by column; then those that follow worst, read on their own.
    crossed, answered, hit = crossed_findings(data, motion, follows, clean, settings)
    findings += crossed
    rows = np.repeat(hit, np.diff(motion.starts))
    commanded[rows] = answered[rows]
    clean &= ~hit
    if width not in CARTESIAN:
        return findings, commanded
    odd = _follow_badly(motion, clean, settings.maximum_lag_rows)
    if some(np.isin(np.arange(len(clean)), odd), len(clean), settings.outlier_share):
        found = _frame(motion, odd, settings)
        if found is not None and found.kind:
            _answer(commanded, motion, odd, found)
            where = f"{len(odd)} episodes ({listed(data.episodes.uuid[odd])})"
            findings.append(_finding(data, motion, where, found, settings))
    return findings, commanded


def _answer(commanded: Array, motion: Motion, episodes: Integers, found: Frame) -> None:
    """Put the commanded motion of the episodes as it is answered."""
    rows = np.isin(motion.segment, episodes)
    commanded[rows] = motion.commanded[rows][:, found.swapped] @ found.turn.T


def _follow_badly(motion: Motion, among: Flags, maximum_rows: int) -> Integers:
    """Episodes whose motion is explained far worse by their command than usual."""
    everything = _displacements(motion, np.flatnonzero(among), maximum_rows, sample=False)
    if everything is None:
        return np.zeros(0, dtype=np.int64)
    x, y, group = everything.x, everything.y[len(FRACTIONS) // 2], everything.group
    # Episodes that are too short have no displacements, the last one included.
    edges = np.searchsorted(group, np.arange(np.count_nonzero(among) + 1))
    scale = np.sqrt(np.mean(y**2, axis=0))
    own = (x**2).sum(axis=0)
    gains = np.maximum((x * y).sum(axis=0), 0.0) / np.where(own > 0, own, np.inf)
    left = ((y - x * gains) / np.where(scale > 0, scale, np.inf)) ** 2
    power = (y / np.where(scale > 0, scale, np.inf)) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        share = episode_sums(left.sum(axis=1), edges) / episode_sums(power.sum(axis=1), edges)
    known = np.isfinite(share)
    if np.count_nonzero(known) < LEAST_EPISODES:
        return np.zeros(0, dtype=np.int64)
    centre, spread = densest_half(share[known])
    odd = known & (np.nan_to_num(share) > max(ODD_SHARE, centre + ODD_SPREADS * spread))
    return np.asarray(np.flatnonzero(among)[odd], dtype=np.int64)


def _frame(motion: Motion, episodes: Integers, settings: AuditSettings) -> Frame | None:
    """Frame of a group of episodes, if both halves of it say the same."""
    whole = _displacements(motion, episodes, settings.maximum_lag_rows)
    if whole is None:
        return None
    read = _read(whole, settings)
    if not read.kind and read.angle_rad == 0.0:
        return read
    for half in (0, 1):
        other = _read(whole.of(whole.group % 2 == half), settings)
        gap = _angle(read.turn @ other.turn.T)
        same = other.kind == read.kind and np.array_equal(other.swapped, read.swapped)
        if not (same and HALVES * max(read.angle_rad, 1e-9) - gap >= 0):
            return None
    return read


def _read(moves: Displacements, settings: AuditSettings) -> Frame:
    """What maps the commanded displacements on the observed ones."""
    width = moves.x.shape[1]
    clean = Frame(np.arange(width), np.eye(width), 0.0, "")
    if len(moves.x) < 10 * width:
        return clean
    correlation = _correlation(moves.x, moves.y[len(FRACTIONS) // 2])
    order = _assignment(correlation)
    if not np.array_equal(order, np.arange(width)):
        return Frame(order, np.eye(width), 0.0, "swapped_columns")
    if width in CARTESIAN:
        turn, better = _turn(moves)
        angle = _angle(turn)
        if not better:
            return clean
        beyond = np.linalg.det(turn) < 0 or not settings.frame_floor_rad - angle >= 0
        return Frame(np.arange(width), turn, angle, "frame" if beyond else "")
    flipped = np.diag(correlation) <= -FOLLOWS
    if flipped.any():
        return Frame(np.arange(width), np.diag(np.where(flipped, -1.0, 1.0)), np.pi, "frame")
    return clean


def _assignment(correlation: Array) -> Integers:
    """For each observed column the command that it answers, beyond doubt; else its own."""
    width = len(correlation)
    moving = np.flatnonzero(np.max(correlation, axis=1) >= FOLLOWS)
    moving = moving[np.max(correlation[:, moving], axis=0) >= FOLLOWS] if len(moving) else moving
    order = np.arange(width)
    if len(moving) < 2:
        return order
    rows, columns = linear_sum_assignment(-correlation[np.ix_(moving, moving)])
    proposed = order.copy()
    proposed[moving[rows]] = moving[columns]
    changed = np.flatnonzero(proposed != order)
    if len(changed) == 0:
        return order
    taken = correlation[changed, proposed[changed]]
    own = correlation[changed, changed]
    left = 1.0 - taken**2
    clear = (taken >= FOLLOWS) & (left <= BETTER * (1.0 - np.maximum(own, 0.0) ** 2))
    return proposed if clear.all() else order


def _correlation(x: Array, y: Array) -> Array:
    """Correlation of observed column i with command j. Shape (P, P)."""
    scale = np.sqrt((y**2).sum(axis=0))[:, None] * np.sqrt((x**2).sum(axis=0))
    return np.asarray((y.T @ x) / np.where(scale > 0, scale, np.inf))


def _turn(moves: Displacements) -> tuple[Array, bool]:
    """Orthogonal Procrustes turn, and whether it tells more than a gain of each axis.

    Both readings take the fraction of a row that suits them best: a lag in a bend looks like a
    turn.
    """
    x, power = moves.x, float((moves.x**2).sum())
    own = (x**2).sum(axis=0)
    width = x.shape[1]
    turn, turned, straight, total, flat = np.eye(width), np.inf, np.inf, 0.0, True
    for y in moves.y:
        u, singular, v = np.linalg.svd(y.T @ x)
        left = float((y**2).sum()) - float(singular.sum()) ** 2 / max(power, 1e-300)
        if left < turned:
            turn, turned, total = u @ v, left, float((y**2).sum())
            # Motion along one line has no frame: the second direction must carry a part of it.
            flat = bool(singular[1] < 0.02 * singular[0])
        gains = np.maximum((x * y).sum(axis=0), 0.0) / np.where(own > 0, own, np.inf)
        straight = min(straight, float(((y - x * gains) ** 2).sum()))
    better = turned <= TURN_BETTER * straight and turned <= (1.0 - FOLLOWS**2) * total
    return turn, bool(better and not flat)


def _angle(turn: Array) -> float:
    """Angle of a rotation, rad; that of a mirror is pi where it is no rotation."""
    width = len(turn)
    if np.linalg.det(turn) < 0:
        return float(np.pi)
    if width == 2:
        return float(abs(np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])))
    if width == 3:
        return float(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))
    return 0.0 if np.allclose(turn, np.eye(width)) else float(np.pi)


def _displacements(
    motion: Motion, episodes: Integers, maximum_rows: int, *, sample: bool = True
) -> Displacements | None:
    """Commanded and observed displacements at the lag that fits best under any linear map."""
    if len(episodes) == 0:
        return None
    length = np.diff(motion.starts)[episodes]
    share = max(1, int(np.ceil(length.sum() / LARGEST_SAMPLE))) if sample else 1
    chosen = episodes[::share]
    maximum_rows = min(maximum_rows, int(np.median(length)) // 4)
    reach = SPAN_ROWS + maximum_rows
    rows, numbers = [], []
    for number, episode in enumerate(chosen):
        first, last = int(motion.starts[episode]), int(motion.starts[episode + 1])
        inner = np.arange(first + maximum_rows + 1, last - reach - 1)
        rows.append(inner)
        numbers.append(np.full(len(inner), number))
    at, group = np.concatenate(rows), np.concatenate(numbers)
    # No displacement reaches over a splice.
    piece = np.repeat(np.arange(len(motion.pieces) - 1), np.diff(motion.pieces))
    if len(at):
        whole = piece[at - maximum_rows - 1] == piece[at + reach + 1]
        at, group = at[whole], group[whole]
    if len(at) < 10 * motion.commanded.shape[1]:
        return None
    x = motion.commanded[at + SPAN_ROWS] - motion.commanded[at]
    scale = np.maximum(np.std(x, axis=0), 1e-12)
    shifts = np.arange(-maximum_rows, maximum_rows + 1)
    left = [_unexplained(x / scale, _moved(motion.observed, at + shift)) for shift in shifts]
    best = at + int(shifts[int(np.argmin(left))])
    before, here, after = (_moved(motion.observed, best + step) for step in (-1, 0, 1))
    y = [
        here + fraction * ((after - here) if fraction > 0 else (here - before))
        for fraction in FRACTIONS
    ]
    return Displacements(x, np.stack(y), group)


def _moved(values: Array, at: Integers) -> Array:
    """Displacements that begin at the rows. Shape (n, P)."""
    return np.asarray(values[at + SPAN_ROWS] - values[at])


def _unexplained(x: Array, y: Array) -> float:
    """Share of `y` that no linear map of `x` gives, the columns of `y` counting alike."""
    gram = x.T @ x + 1e-6 * len(x) * np.eye(x.shape[1])
    cross = x.T @ y
    explained = (cross * np.linalg.solve(gram, cross)).sum(axis=0)
    power = (y**2).sum(axis=0)
    moving = power > 0
    return float(np.mean(1.0 - explained[moving] / power[moving])) if moving.any() else 1.0


def _finding(
    data: AuditInput, motion: Motion, where: str, found: Frame, settings: AuditSettings
) -> Finding:
    if found.kind == "swapped_columns":
        changed = np.flatnonzero(found.swapped != np.arange(len(found.swapped)))
        names = ", ".join(
            f"{motion.names[i]} answers the command of {motion.names[found.swapped[i]]}"
            for i in changed
        )
        return Finding(
            kind="swapped_columns",
            variable=motion.names[changed[0]],
            where=where,
            question="swapped_columns",
            measured=float(len(changed)),
            floor=0.0,
            unit="columns",
            action=f"Put the columns of {where} in order ({names}), ingest again and repeat the "
            "audit.",
        )
    mirrored = np.linalg.det(found.turn) < 0 or len(motion.names) not in CARTESIAN
    flipped = [motion.names[i] for i in np.flatnonzero(np.diag(found.turn) < -0.5)]
    what = (
        f"mirrored ({', '.join(flipped) or 'across a diagonal'})"
        if mirrored
        else f"turned by {np.degrees(found.angle_rad):.0f} degrees"
    )
    return Finding(
        kind="frame",
        variable=data.position_stream,
        where=where,
        question="frame_angle_rad",
        measured=found.angle_rad,
        floor=settings.frame_floor_rad,
        unit="rad",
        action=f"In {where} the observed motion is the commanded one {what}: express both in one "
        "frame, ingest again and repeat the audit.",
    )
