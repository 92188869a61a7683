"""Crossed columns: episodes in which a column answers minus its command, or another's.

Each column of each episode is read by itself. A joint is flipped where it follows the negative of
its command and not its command, by as much as it usually does; two are swapped where each follows
the command of the other and not its own. What is said of fewer episodes than a mishap is not said.
"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags
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
# Log likelihood ratio of the other reading of one column in one episode; a swap needs it of both
# columns, and a finding of two episodes. Joints of a short and single movement are all alike.
CLEAR = 5.0
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
    minus = flipped(found, motion.directional) & among[:, None]
    total = int(np.count_nonzero(among))
    turned = [k for k in range(minus.shape[1]) if some(minus[:, k], total, settings.outlier_share)]
    if turned:
        for column in turned:
            rows = np.repeat(minus[:, column], np.diff(motion.starts))
            commanded[rows, column] *= -1.0
            hit |= minus[:, column]
        findings.append(_flipped(data, motion, minus, turned, settings))
    exchanged = swapped(found, column_correlations(found, motion.starts)) & among[:, None, None]
    for first, second in np.argwhere(np.triu(exchanged.any(axis=0))):
        both = exchanged[:, first, second]
        if not some(both, total, settings.outlier_share):
            continue
        at = np.flatnonzero(np.repeat(both, np.diff(motion.starts)))
        commanded[at[:, None], [first, second]] = commanded[at[:, None], [second, first]]
        hit |= both
        findings.append(_swapped(data, motion, both, (int(first), int(second))))
    return findings, commanded, hit


def flipped(found: Following, directional: Flags) -> Flags:
    """Columns that answer the negative of their command, by episode. Shape (E, P)."""
    minus, plus = np.nan_to_num(found.negative), np.maximum(np.nan_to_num(found.positive), 0.0)
    clear = (minus >= FOLLOWS) & (_evidence(found, plus, minus) >= CLEAR)
    with np.errstate(divide="ignore", invalid="ignore"):
        gains = np.where(found.follows, np.log(found.seen) - np.log(found.asked), np.nan)
    usual = np.array(
        [np.median(g[np.isfinite(g)]) if np.isfinite(g).any() else 0.0 for g in gains.T]
    )
    alike = np.abs(np.nan_to_num(gains - usual, nan=np.inf)) <= np.log(ALIKE)
    return np.asarray(clear & alike & ~directional)


def swapped(found: Following, correlation: Array) -> Flags:
    """Pairs of columns that answer each other's command, by episode. Shape (E, P, P)."""
    own = np.maximum(np.nan_to_num(found.positive), 0.0)[:, :, None]
    other = (correlation >= FOLLOWS) & (_evidence(found, own, correlation) >= CLEAR)
    both = other & other.transpose(0, 2, 1)
    both[:, np.arange(both.shape[1]), np.arange(both.shape[1])] = False
    return np.asarray(both)


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
