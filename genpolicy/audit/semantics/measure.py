"""All measures of data semantics, and the findings in the order of diagnosis.

Units and frames come first: clocks are then measured on the motion as it is answered, so that a
turned frame is not taken for a lag. What is reported stands out of what the spread of the episodes
explains, and of a floor below which nothing is looked for; whether it is a fault is not said here.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Integers
from genpolicy.audit.rows import Clock, Finding
from genpolicy.audit.semantics import calibration, continuity, copies
from genpolicy.audit.semantics.alignment import aligned
from genpolicy.audit.semantics.clocks import (
    EPISODE_DELAYS,
    EPISODE_STEPS,
    delay_clocks,
    leading_findings,
    measure_lags,
    offset_findings,
    position_clocks,
    shift_rows,
)
from genpolicy.audit.semantics.copy_findings import copy_findings, glued_findings
from genpolicy.audit.semantics.drift import (
    delay_drift_findings,
    drift_findings,
    episode_drifts,
    order_findings,
)
from genpolicy.audit.semantics.following import Following, following
from genpolicy.audit.semantics.frames import frame_findings
from genpolicy.audit.semantics.frozen import frozen_findings, stream_gap_findings
from genpolicy.audit.semantics.gains import part_gain_findings
from genpolicy.audit.semantics.motion import Motion, make_motion
from genpolicy.audit.semantics.offsets import part_findings
from genpolicy.audit.semantics.report import Semantics, in_order
from genpolicy.audit.semantics.robust import episode_medians
from genpolicy.audit.semantics.streams import stream_lags
from genpolicy.audit.semantics.units import (
    component_findings,
    gain_findings,
    magnitude_findings,
    mattering,
)
from genpolicy.audit.settings import AuditSettings

# A change of the lag over the recordings below this is no clock, steps.
ORDER_STEPS = 1.0
# What stands beside its command for these reasons is not asked whether it is calibrated, nor
# whether it goes by another factor; where rows are lost, what is added up of rates does.
MOVED = {"frozen", "clock", "clock_drift"}


def measure(data: AuditInput, settings: AuditSettings) -> Semantics:
    """Clocks, frames, units, continuity, copies and calibration of canonical data."""
    made = make_motion(data)
    copied = copies.find_copies(data, made)
    # Where a second copy begins both jump together, which looks like a response without lag.
    pieces = np.union1d(made.pieces, sorted(copied.joins)).astype(np.int64)
    motion = replace(made, pieces=pieces)
    notes: list[str] = []
    if motion.wraps:
        notes.append(f"{motion.wraps} jumps by a whole turn were taken out of angles.")
    frozen, untold = frozen_findings(data, motion, settings)
    follows = following(motion, data.period_s, settings.maximum_lag_rows)
    turned, answered = frame_findings(data, motion, follows, settings)
    # A column that answers another's command is larger or smaller than its own, and no unit.
    asked = replace(motion, commanded=answered)
    findings, factors = gain_findings(data, asked, follows, settings)
    findings += [*magnitude_findings(data, motion, settings), *turned]
    repeated = np.repeat(factors, np.diff(motion.starts))[:, None]
    recorded, motion = motion, replace(motion, commanded=answered * repeated)
    if not findings:
        findings += component_findings(data, recorded, follows, settings)
    motion = aligned(motion, follows, settings.maximum_lag_rows)
    clocks, shift, found = _position(data, motion, settings)
    findings += found
    others, stream_shift, found, unclocked = _others(data, motion, shift, settings)
    findings += found
    stubs, remarks = continuity.stub_findings(data, motion, settings)
    releases = calibration.calibrations(data, settings)
    negative = continuity.negative_delays(data, settings)
    findings += [
        *frozen,
        *stream_gap_findings(data, motion, settings),
        *continuity.negative_findings(negative),
        *continuity.time_findings(data, settings),
        *stubs,
        *glued_findings(copied, data, made, settings),
        *copy_findings(copied, data, settings),
        *calibration.release_findings(data, releases, settings),
    ]
    findings += _of_parts(data, recorded, follows, findings, settings)
    wander = calibration.start_note(data)
    shared = _shared_offset(data, settings)
    return Semantics(
        clocks=(*clocks, *others),
        calibrations=releases,
        gaps=continuity.gap_count(data),
        start_drift=calibration.start_drift(data),
        findings=in_order(findings),
        notes=(*notes, *remarks, *(note for note in (wander, shared) if note)),
        shift_rows=shift,
        stream_shift_rows=stream_shift,
        unclocked=unclocked,
        untold_freezes=untold,
    )


def _of_parts(
    data: AuditInput,
    motion: Motion,
    follows: Following,
    found: Sequence[Finding],
    settings: AuditSettings,
) -> list[Finding]:
    """Factors and offsets of epochs and of parts of the episodes, where nothing else is why."""
    kinds = {finding.kind for finding in found}
    if kinds & {"unit", "frame", "swapped_columns"}:
        return []
    if not kinds & {"gaps", *MOVED}:
        sized = mattering(data, motion) & ~motion.directional
        if gained := part_gain_findings(data, motion, follows, sized, settings):
            return gained
    offsets = calibration.offset_findings(data, motion, settings)
    if offsets or kinds & {"calibration", *MOVED}:
        return offsets
    return part_findings(data, motion, follows, settings)


def _shared_offset(data: AuditInput, settings: AuditSettings) -> str:
    """What no comparison of epochs and episodes can show; empty where nothing is compared.

    Every delay and lag is held against the usual one of its own stream. A receive time bounds an
    offset on one side only: what is received before it happened is counted (`negative_delays`).
    """
    streams = {*data.delay_s, *(set(data.streams) - {data.position_stream})}
    if settings.declared_lag_rows is not None:
        streams -= {data.position_stream}
    if not streams:
        return ""
    return (
        f"Not looked at: an offset of the clock of {', '.join(sorted(streams))} that is the same "
        "in all episodes and epochs. It looks like a slower link or a slower robot; only a lag "
        "that was declared, or an event that two streams see, shows it."
    )


def _position(
    data: AuditInput, motion: Motion, settings: AuditSettings
) -> tuple[list[Clock], Integers, list[Finding]]:
    """Clocks, shift and findings of the stream of the position."""
    stream, period = data.position_stream, data.period_s
    lags = measure_lags(motion, settings)
    offsets = lags.steps * period
    declared = settings.declared_lag_rows
    findings, taken = offset_findings(
        stream,
        offsets,
        data,
        settings,
        declared_s=None if declared is None else declared * period,
        finest_s=settings.clock_resolution_rows * period,
        episode_limit_s=max(EPISODE_STEPS * period, settings.clock_floor_s),
        errors_s=lags.error * period,
    )
    if not findings:
        findings += leading_findings(lags.steps, data, settings)
        findings += order_findings(
            stream,
            offsets,
            data,
            settings,
            limit_s=max(ORDER_STEPS * period, settings.clock_floor_s),
        )
    if not findings and stream in data.delay_s:
        # A stamp that says too early is held back until it was received: rows stay as they are,
        # and only the delay shows that the ages are wrong.
        findings += _by_delay(data, stream, motion, settings)[0]
    findings += drift_findings(episode_drifts(motion, lags.steps, settings), data, settings)
    return position_clocks(data, lags.steps, settings), shift_rows(taken, period), findings


def _others(
    data: AuditInput, motion: Motion, shift: Integers, settings: AuditSettings
) -> tuple[list[Clock], dict[str, Integers], list[Finding], tuple[str, ...]]:
    """Clocks, shifts and findings of all other streams: by delay, and by motion where they move.

    Last, the streams that could be looked at in neither way.
    """
    clocks: list[Clock] = []
    findings: list[Finding] = []
    shifts: dict[str, Integers] = {}
    unclocked: list[str] = []
    names = sorted({*data.delay_s, *data.streams} - {data.position_stream})
    for stream in names:
        taken = np.zeros(len(data.episodes))
        if stream in data.delay_s:
            clocks += delay_clocks(data, stream, motion.starts)
            found, taken = _by_delay(data, stream, motion, settings)
            findings += found
        if stream in data.streams:
            seen = _by_motion(data, stream, motion, shift, settings)
            if seen is None and stream not in data.delay_s:
                unclocked.append(stream)
            found, moved = seen or ([], taken)
            # One fault shows in both: it is said once.
            if found and not any(item.variable == stream for item in findings):
                findings += found
                taken = moved
        shifts[stream] = shift_rows(taken, data.period_s)
    return clocks, shifts, findings, tuple(unclocked)


def _by_delay(
    data: AuditInput, stream: str, motion: Motion, settings: AuditSettings
) -> tuple[list[Finding], Array]:
    # A stream whose clock runs ahead seems to arrive too early: the sign is turned.
    offsets = -episode_medians(data.delay_s[stream], motion.starts)
    findings, taken = offset_findings(
        stream,
        offsets,
        data,
        settings,
        declared_s=None,
        finest_s=settings.clock_floor_s,
        episode_limit_s=EPISODE_DELAYS * settings.clock_floor_s,
    )
    if not findings:
        findings += order_findings(stream, offsets, data, settings, limit_s=settings.clock_floor_s)
    return findings + delay_drift_findings(stream, data, motion.starts, settings), taken


def _by_motion(
    data: AuditInput, stream: str, motion: Motion, shift: Integers, settings: AuditSettings
) -> tuple[list[Finding], Array] | None:
    columns = np.arange(data.observation.shape[1])[data.streams[stream]]
    lags = stream_lags(data, motion, columns, settings)
    if lags is None:
        return None
    # What is late against a late position is late by both.
    offsets = (lags.steps + shift) * data.period_s
    findings, taken = offset_findings(
        stream,
        offsets,
        data,
        settings,
        declared_s=None,
        finest_s=settings.clock_resolution_rows * data.period_s,
        episode_limit_s=max(EPISODE_STEPS * data.period_s, settings.clock_floor_s),
        errors_s=lags.error * data.period_s,
    )
    if not findings:
        limit = max(ORDER_STEPS * data.period_s, settings.clock_floor_s)
        findings = order_findings(stream, offsets, data, settings, limit_s=limit)
    return findings, taken
