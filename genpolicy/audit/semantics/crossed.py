"""Crossed columns: episodes in which a column answers minus its command, or another's.

Each column of each episode is read by itself. A joint is flipped where it follows the negative of
its command and not its command, by as much as it usually does; two are swapped where each follows
the command of the other better than its own. In a short movement all joints are alike and one
episode proves little; so all episodes are asked together whether a share of them is swapped. What
is said of fewer episodes than a mishap is not said.
"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.following import (
    FOLLOWS,
    Following,
    column_correlations,
)
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.report import listed
from genpolicy.audit.semantics.robust import some
from genpolicy.audit.settings import AuditSettings

# A flipped joint moves by as much as it usually does, within this factor: what is dragged along by
# the others moves by less.
ALIKE = 2.0
# Log likelihood ratio of the other reading: of a flipped column in one episode, and of a share of
# swapped episodes against none, beyond the number of pairs that are asked.
CLEAR, CLEAR_SHARE = 5.0, 10.0
# Shares of swapped episodes that are tried.
SHARES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9)
# One of both columns leaves so many times as much of its own command, by the usual gain, as of the
# other's: two that move alike in shape differ in size.
MISFIT = 4.0
# Correlations are not believed nearer to one.
ROUNDING = 1e-4


def crossed_findings(
    data: AuditInput, motion: Motion, found: Following, among: Flags, settings: AuditSettings
) -> tuple[list[Finding], Array, Flags]:
    """Flipped and swapped columns in a part of the episodes.

    Args:
        data: Canonical data.
        motion: Commanded and observed motion.
        found: How each column follows its command.
        among: Episodes that no other finding of frames speaks of. Shape (E,).
        settings: Limits.

    Returns:
        Findings, the commanded motion as it is answered, shape (N, P), and the episodes that they
        speak of, shape (E,).
    """
    commanded = motion.commanded.copy()
    hit = np.zeros(len(among), dtype=bool)
    findings: list[Finding] = []
    minus = flipped(found, motion.directional, settings.maximum_lag_rows) & among[:, None]
    total = int(np.count_nonzero(among))
    turned = [k for k in range(minus.shape[1]) if some(minus[:, k], total, settings.outlier_share)]
    if turned:
        for column in turned:
            rows = np.repeat(minus[:, column], np.diff(motion.starts))
            commanded[rows, column] *= -1.0
            hit |= minus[:, column]
        findings.append(_flipped(data, motion, minus, turned, settings))
    near = _near(found, found.common_lag, settings.maximum_lag_rows)
    exchanged = swapped(found, column_correlations(found, motion.starts), among & near)
    for first, second in np.argwhere(np.triu(exchanged.any(axis=0))):
        both = exchanged[:, first, second]
        if not some(both, total, settings.outlier_share):
            continue
        at = np.flatnonzero(np.repeat(both, np.diff(motion.starts)))
        commanded[at[:, None], [first, second]] = commanded[at[:, None], [second, first]]
        hit |= both
        findings.append(_swapped(data, motion, both, (int(first), int(second))))
    return findings, commanded, hit


def flipped(found: Following, directional: Flags, maximum_rows: int) -> Flags:
    """Columns that answer the negative of their command, by episode. Shape (E, P)."""
    minus, plus = np.nan_to_num(found.negative), _own(found)
    clear = (minus >= FOLLOWS) & (_evidence(found, plus, minus) >= CLEAR)
    gains, usual = _gains(found)
    alike = np.abs(np.nan_to_num(gains - usual, nan=np.inf)) <= np.log(ALIKE)
    near = _near(found, found.lag, maximum_rows)
    return np.asarray(clear & alike & near & ~directional)


def swapped(found: Following, correlation: Array, among: Flags) -> Flags:
    """Pairs of columns that answer each other's command, by episode. Shape (E, P, P)."""
    own = _own(found)
    each = _evidence(found, own[:, :, None], correlation)
    better = (correlation >= FOLLOWS) & (each > 0)
    odd = _misfits(found, own)[:, :, None] >= MISFIT * np.maximum(1.0 - correlation**2, ROUNDING)
    both = each + each.transpose(0, 2, 1)
    both[~(better & better.transpose(0, 2, 1))] = -np.inf
    both[~(odd | odd.transpose(0, 2, 1))] = -np.inf
    width = both.shape[1]
    both[:, np.arange(width), np.arange(width)] = -np.inf
    # Episodes in which one of both stands, or that are not asked, speak for nothing.
    read = among[:, None] & np.isfinite(found.positive)
    asked = read[:, :, None] & read[:, None, :]
    shares = np.array(SHARES)
    total = np.stack([
        np.where(asked, np.logaddexp(np.log1p(-p), np.log(p) + both), 0.0).sum(axis=0)
        for p in shares
    ])  # fmt: skip
    share = shares[total.argmax(axis=0)]
    enough = CLEAR_SHARE + np.log(max(width * (width - 1) // 2, 1))
    clear = (both + np.log(share / (1.0 - share)) > 0) & (total.max(axis=0) >= enough)
    pairs = asked & clear
    # A column answers one command. What answers many is read wrong, behind a lag or at rest.
    alone = pairs.sum(axis=2) == 1
    return np.asarray(pairs & alone[:, :, None] & alone[:, None, :])


def _near(found: Following, lag: Integers, maximum_rows: int) -> Flags:
    """Lags about the usual one: what goes to and fro answers its negative half a round later."""
    follows = _own(found) >= FOLLOWS
    known = found.lag[follows if follows.any() else found.follows]
    usual = float(np.median(known)) if len(known) else 0.0
    return np.asarray(np.abs(lag - usual) <= maximum_rows / 2.0)


def _own(found: Following) -> Array:
    """Correlation of each column with its own command, 0 where there is none. Shape (E, P)."""
    return np.asarray(np.maximum(np.nan_to_num(found.positive), 0.0))


def _gains(found: Following) -> tuple[Array, Array]:
    """Logarithm of each gain, NaN where nothing is followed; and the usual ones. Shape (P,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        gains = np.where(found.follows, np.log(found.seen) - np.log(found.asked), np.nan)
    usual = [np.median(g[np.isfinite(g)]) if np.isfinite(g).any() else 0.0 for g in gains.T]
    return gains, np.array(usual)


def _misfits(found: Following, own: Array) -> Array:
    """What each column leaves of its own command, in size and shape, of its motion. Shape (E, P).

    By one gain for all columns: that of a column would be the wrong one where most are swapped.
    """
    gains = _gains(found)[0]
    usual = np.exp(np.median(gains[np.isfinite(gains)])) if np.isfinite(gains).any() else 1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        asked = usual * found.asked / found.seen
        left = 1.0 + asked**2 - 2.0 * own * asked
    return np.asarray(np.where(np.isfinite(left), left, 0.0))


def _evidence(found: Following, own: Array, other: Array) -> Array:
    """Log likelihood ratio of the other reading against a column's own, of independent rows."""
    left = [np.log(np.maximum(1.0 - value**2, ROUNDING)) for value in (own, other)]
    count = found.independent.reshape(-1, *[1] * (own.ndim - 1))
    return np.asarray(0.5 * count * (left[0] - left[1]))


def _flipped(
    data: AuditInput, motion: Motion, minus: Flags, columns: list[int], settings: AuditSettings
) -> Finding:
    episodes = minus[:, columns].any(axis=1)
    names = data.episodes.uuid[episodes]
    joints = ", ".join(motion.names[k] for k in columns)
    most = int(np.argmax(minus[:, columns].sum(axis=0)))
    return Finding(
        kind="frame",
        variable=motion.names[columns[most]],
        where=f"{len(names)} episodes ({listed(names)})",
        question="frame_angle_rad",
        measured=float(np.pi),
        floor=settings.frame_floor_rad,
        unit="rad",
        action=f"In {len(names)} episodes ({listed(names)}) {joints} moves against its command: "
        "give commands and observations the same sign, ingest again and repeat the audit.",
    )


def _swapped(data: AuditInput, motion: Motion, chosen: Flags, pair: tuple[int, int]) -> Finding:
    names = data.episodes.uuid[chosen]
    first, second = (motion.names[k] for k in pair)
    where = f"{len(names)} episodes ({listed(names)})"
    return Finding(
        kind="swapped_columns",
        variable=first,
        where=where,
        question="swapped_columns",
        measured=2.0,
        floor=0.0,
        unit="columns",
        action=f"Put the columns of {where} in order ({first} answers the command of {second}, and "
        f"{second} that of {first}), ingest again and repeat the audit.",
    )
