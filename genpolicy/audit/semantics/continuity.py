"""Continuity: time that runs evenly, samples after their exposure, episodes that are episodes."""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags
from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.report import listed
from genpolicy.audit.semantics.robust import episode_deviation, episode_sums, some
from genpolicy.audit.settings import AuditSettings

GAP_PERIODS = 1.5
# Two times on two clocks, or rows out of order: counted, and held against this limit.
DISORDER = "clock_disorder"
# An episode shorter than this share of the usual one, whose command never changes, is none.
STUB_SHARE = 0.1
# Rows whose command repeats while the arm moves, worth a note from this share on.
FROZEN_SHARE = 0.2


def gap_count(data: AuditInput) -> int:
    """Rows that follow a gap in time."""
    steps, inside = _steps(data)
    return int(np.count_nonzero(steps[inside] > GAP_PERIODS * data.period_s))


def negative_delays(data: AuditInput, settings: AuditSettings) -> int:
    """Samples received before they happened, beyond the tolerance."""
    return sum(
        int(np.count_nonzero(delay < -settings.negative_delay_tolerance_s))
        for delay in data.delay_s.values()
    )


def negative_findings(negative: int) -> list[Finding]:
    """Samples from the future: two times on two clocks."""
    if not negative:
        return []
    action = (
        f"{negative} samples were received before they happened: put both times on one clock and "
        "ingest again."
    )
    return [
        Finding("clock", "", "receive times", DISORDER, float(negative), 0.0, "samples", action)
    ]


def time_findings(data: AuditInput, settings: AuditSettings) -> list[Finding]:
    """Times that do not rise, another rate than declared, too many gaps, too much jitter."""
    steps, inside = _steps(data)
    spans = steps[inside]
    if len(spans) == 0:
        return []
    back = int(np.count_nonzero(spans <= 0.0))
    if back:
        action = f"{back} rows do not come after the row before: sort or repair the times."
        return [Finding("clock", "", "event times", DISORDER, float(back), 0.0, "rows", action)]
    median = float(np.median(spans))
    off = abs(median / data.period_s - 1.0)
    if not settings.rate_floor - off >= 0:
        action = (
            f"Rows come every {median:.4g} s where {data.period_s:.4g} s is declared: correct the "
            "declared rate, or resample."
        )
        where, question = "all episodes", "rate_deviation"
        return [Finding("rate", "", where, question, off, settings.rate_floor, "share", action)]
    findings = []
    gaps = float(np.mean(spans > GAP_PERIODS * data.period_s))
    if not settings.gap_share_floor - gaps >= 0:
        action = (
            f"{gaps:.1%} of the rows follow a gap in time: split the episodes there or resample, "
            "and repeat the audit."
        )
        findings.append(_share("gaps", "gap_share", gaps, settings.gap_share_floor, action))
    jitter = float(np.quantile(np.abs(spans - median), 0.9)) / median
    if not settings.jitter_floor_share - jitter >= 0:
        action = (
            f"Every tenth row comes {jitter:.0%} of a period or more beside its time: resample by "
            "event time, ingest again and repeat the audit."
        )
        findings.append(
            _share("jitter", "jitter_share", jitter, settings.jitter_floor_share, action)
        )
    return findings


def _share(kind: str, question: str, measured: float, floor: float, action: str) -> Finding:
    return Finding(kind, "", "event times", question, measured, floor, "share", action)


def stub_findings(
    data: AuditInput, motion: Motion, settings: AuditSettings
) -> tuple[list[Finding], list[str]]:
    """Recordings in which nothing was done, filed under success; and notes on frozen commands."""
    length = np.diff(motion.starts)
    moved = episode_deviation(data.action, motion.starts).max(axis=1)
    still = moved <= 1e-9 * max(float(np.median(moved)), 1e-300)
    short = (length < STUB_SHARE * np.median(length)) | (length <= 3)
    stub = (still | short) & (data.episodes.outcome != "failure")
    notes: list[str] = []
    if stub.any():
        names = listed(data.episodes.uuid[stub])
        text = f"{int(stub.sum())} of {len(stub)} episodes hold no demonstration ({names})"
        if some(stub, len(stub), settings.outlier_share):
            return [
                Finding(
                    kind="stub",
                    variable="outcome",
                    where=names,
                    question="faulty_episodes_share",
                    measured=float(np.mean(stub)),
                    floor=settings.outlier_share,
                    unit="share",
                    action=f"{text}: their command never changes or they end at once. Leave them "
                    "out and repeat the audit.",
                )
            ], notes
        notes.append(f"{text}: leave them out.")
    frozen = _frozen(data, motion)
    if frozen >= FROZEN_SHARE:
        notes.append(
            f"In {frozen:.0%} of the rows in which the arm moves the command repeats the one "
            "before: targets come more slowly than rows."
        )
    return [], notes


def _steps(data: AuditInput) -> tuple[Array, Flags]:
    return np.diff(data.event_time_s), data.episode[1:] == data.episode[:-1]


def _frozen(data: AuditInput, motion: Motion) -> float:
    """Share of the moving rows whose whole command repeats the one before."""
    if motion.observed.shape[1] == 0:
        return 0.0
    inside = data.episode[1:] == data.episode[:-1]
    steps = np.linalg.norm(np.diff(motion.observed, axis=0), axis=1)
    rows = np.concatenate([[0.0], np.where(inside, steps, 0.0)])
    typical = float(np.sum(episode_sums(rows, motion.starts))) / max(len(rows), 1)
    moving = inside & (steps > 0.5 * typical)
    same = np.all(np.diff(data.action, axis=0) == 0.0, axis=1)
    return float(np.mean(same[moving])) if moving.any() else 0.0
