"""What is said of copies: episodes filed twice, and episodes joined to others or to themselves."""

import numpy as np

from genpolicy.audit.data import AuditInput, Text
from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.copies import Copies
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.report import listed
from genpolicy.audit.semantics.robust import some
from genpolicy.audit.settings import AuditSettings


def copy_findings(copies: Copies, data: AuditInput, settings: AuditSettings) -> list[Finding]:
    """Duplicates as a finding."""
    names, total = data.episodes.uuid, len(data.episodes)
    if not some(copies.duplicate, total, settings.outlier_share):
        return []
    first = np.flatnonzero(copies.duplicate)[:3]
    pairs = "; ".join(f"{names[k]} of {names[copies.of[k]]}" for k in first)
    what = f"are copies of others ({pairs}): keep one of each and repeat the audit."
    return [_of_episodes("duplicate", names[copies.duplicate], total, settings, what)]


def glued_findings(
    copies: Copies, data: AuditInput, motion: Motion, settings: AuditSettings
) -> list[Finding]:
    """Episodes that hold their rows twice, or jump in their middle as no motion of these data.

    Args:
        copies: What was found of copies.
        data: Canonical data.
        motion: The motion as it was recorded, with its pieces.
        settings: Share of episodes from which it is said.
    """
    total = len(motion.starts) - 1
    jumps = np.zeros(total, dtype=bool)
    jumps[motion.segment[np.setdiff1d(motion.pieces[:-1], motion.starts)]] = True
    either = copies.repeats_itself | jumps
    if not some(either, total, settings.outlier_share):
        return []
    twice = int(copies.repeats_itself.sum())
    what = [f"hold the same rows twice ({twice})"] if twice else []
    if (jumps & ~copies.repeats_itself).any():
        what.append("jump in their middle")
    names = data.episodes.uuid[either]
    said = f"{' or '.join(what)} ({listed(names)}): several recordings were joined. "
    said += "Split them where they meet and repeat the audit."
    return [_of_episodes("glued", names, total, settings, said)]


def _of_episodes(kind: str, names: Text, total: int, settings: AuditSettings, what: str) -> Finding:
    """That of all episodes these are faulty, and what to do."""
    return Finding(
        kind=kind,
        variable="episode",
        where=listed(names),
        question="faulty_episodes_share",
        measured=len(names) / total,
        floor=settings.outlier_share,
        unit="share",
        action=f"{len(names)} of {total} episodes {what}",
    )
