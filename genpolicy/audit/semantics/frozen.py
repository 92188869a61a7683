"""Frozen and dropped samples: a stream that shows the same while the arm moves.

A live sensor never reads the same in all of its columns for long: its noise alone moves them, and
so does what it looks at. What is counted is the longest stretch of an episode over which every
column of a stream repeats bit by bit, in rows in which the arm moves. A stream that stands that
long in most episodes anyway (a scene that is looked at once, a simulated object without noise)
tells nothing by standing, and is said to be that. Frames that were dropped leave gaps in the time
stamps of their stream, whatever the rows hold meanwhile.
"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.report import listed
from genpolicy.audit.semantics.robust import (
    episode_centred,
    episode_medians,
    episode_sums,
    some,
)
from genpolicy.audit.settings import AuditSettings

# An arm moves in a row whose step is more than this share of its usual one.
MOVING_STEP = 0.2
# A stretch is too long from this many times the usual longest one of an episode.
USUAL_STRETCHES = 5.0
# A sample is late by a gap beyond this many periods of the rows, or of its stream: two frames in a
# row are missing. One that comes a frame late is what a slow link does.
GAP_PERIODS = 1.5
# A stretch of exactly the limit is no longer than it, s.
ROUNDING_S = 1e-9


def frozen_findings(
    data: AuditInput, motion: Motion, settings: AuditSettings
) -> tuple[list[Finding], tuple[str, ...]]:
    """Streams that froze in some episodes; and those of which no freeze could be told.

    Args:
        data: Canonical data; streams without a column that conditions anything are left out.
        motion: Commanded and observed motion as recorded.
        settings: Floor of the length, s, and of the share of episodes.
    """
    moving = _moving(data, motion)
    findings: list[Finding] = []
    untold: list[str] = []
    for stream, columns in _streams(data).items():
        held_s = data.period_s * longest_holds(
            data.observation[:, columns], moving, motion.starts
        ).astype(np.float64)
        usual_s = float(np.median(held_s))
        if not settings.frozen_floor_s - usual_s >= 0:
            untold.append(stream)
            continue
        limit_s = max(settings.frozen_floor_s, USUAL_STRETCHES * usual_s)
        frozen = held_s - limit_s > ROUNDING_S
        if some(frozen, len(frozen), settings.outlier_share):
            findings.append(_frozen(data, stream, held_s, frozen, limit_s))
    return findings, tuple(untold)


def stream_gap_findings(data: AuditInput, motion: Motion, settings: AuditSettings) -> list[Finding]:
    """Streams whose newest sample is too often older than their cadence explains."""
    findings = []
    for stream in _streams(data):
        if stream not in data.stream_time_s:
            continue
        share = late_share(data, motion.starts, data.stream_time_s[stream])
        if not settings.gap_share_floor - share >= 0:
            findings.append(
                Finding(
                    kind="gaps",
                    variable=stream,
                    where="event times",
                    question="gap_share",
                    measured=share,
                    floor=settings.gap_share_floor,
                    unit="share",
                    action=f"In {share:.1%} of the rows the newest sample of stream {stream} is "
                    "older than its cadence explains: samples were dropped. Find out where they "
                    "are lost, leave those episodes out, and repeat the audit.",
                )
            )
    return findings


def longest_holds(values: Array, moving: Flags, starts: Integers) -> Integers:
    """Longest stretch of each episode over which all columns repeat, in rows that move.

    Args:
        values: Columns of one stream. Shape (N, D).
        moving: Whether the arm moves from the row before to this one. Shape (N,).
        starts: First row of each episode, and the number of rows. Shape (E + 1,).

    Returns:
        Shape (E,).
    """
    same = np.zeros(len(values), dtype=bool)
    same[1:] = np.all(values[1:] == values[:-1], axis=1)
    same[starts[:-1][starts[:-1] < len(same)]] = False
    # Rows that move, counted since the last row that brought something new.
    count = np.cumsum(same & moving)
    since: Integers = count - np.maximum.accumulate(np.where(same, 0, count))
    result = np.zeros(len(starts) - 1, dtype=np.int64)
    filled = starts[1:] > starts[:-1]
    if filled.any():
        result[filled] = np.maximum.reduceat(since, starts[:-1][filled])
    return result


def late_share(data: AuditInput, starts: Integers, stamp_s: Array) -> float:
    """Share of rows whose sample is older than usual in its episode by more than a gap.

    An age that grows evenly over an episode is a clock that drifts, and no gap.
    """
    age_s = data.event_time_s - stamp_s
    time_s = episode_centred(data.event_time_s, starts)
    power = np.maximum(episode_sums(time_s**2, starts), 1e-300)
    slope = episode_sums(time_s * episode_centred(age_s, starts), starts) / power
    age_s = age_s - np.repeat(slope, np.diff(starts)) * time_s
    steps = np.diff(stamp_s)[data.episode[1:] == data.episode[:-1]]
    fresh = steps[steps > 0]
    cadence_s = max(data.period_s, float(np.median(fresh)) if len(fresh) else np.inf)
    usual_s = np.repeat(episode_medians(age_s, starts), np.diff(starts))
    return float(np.mean(age_s - usual_s > GAP_PERIODS * cadence_s))


def _streams(data: AuditInput) -> dict[str, Integers]:
    """Columns of each stream that condition a policy; phases and what is ignored are none."""
    used = np.isfinite(data.observation_scale)
    every = np.arange(data.observation.shape[1])
    found = {name: every[index] for name, index in sorted(data.streams.items())}
    found = {name: columns[used[columns]] for name, columns in found.items()}
    return {name: columns for name, columns in found.items() if len(columns)}


def _moving(data: AuditInput, motion: Motion) -> Flags:
    """Whether the arm moves from the row before: by its command, or as it was observed."""
    pairs = (motion.commanded, motion.observed) if data.paired else (data.action,)
    inside = np.concatenate([[False], data.episode[1:] == data.episode[:-1]])
    moving = np.zeros(len(inside), dtype=bool)
    for values in pairs:
        scale = np.std(values, axis=0)
        # Components of one position share their unit; those of an unpaired action do not.
        scaled = values if data.paired else values / np.where(scale > 0, scale, np.inf)
        steps = np.linalg.norm(np.diff(scaled, axis=0, prepend=scaled[:1]), axis=1)
        steps = np.where(inside, steps, 0.0)
        if (steps > 0).any():
            moving |= steps > MOVING_STEP * float(np.median(steps[steps > 0]))
    return moving


def _frozen(data: AuditInput, stream: str, held_s: Array, frozen: Flags, limit_s: float) -> Finding:
    typical_s = float(np.median(held_s[frozen]))
    names = listed(data.episodes.uuid[frozen])
    return Finding(
        kind="frozen",
        variable=stream,
        where=names,
        question="frozen_s",
        measured=typical_s,
        floor=limit_s,
        unit="s",
        action=f"Stream {stream} shows the same for {typical_s:.2f} s while the arm moves, in "
        f"{int(frozen.sum())} of {len(frozen)} episodes ({names}): leave them out, find out why "
        "it froze, and repeat the audit.",
    )
