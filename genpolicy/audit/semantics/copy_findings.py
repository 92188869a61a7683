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
    return findings


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
    return [_glued(data.episodes.uuid[either], total, settings, " or ".join(what))]


def _glued(names: Text, total: int, settings: AuditSettings, what: str) -> Finding:
    count = len(names)
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
