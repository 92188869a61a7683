"""Clock offsets: is what looks like two modes only a shift in time?

The stream of the position is judged by the lag between command and response, any other by its
receive delay and, where its channels move with the arm, by the lag behind that motion. An epoch is
held against all episodes, an episode against its epoch.
"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers, Text
from genpolicy.audit.rows import Clock, Finding
from genpolicy.audit.semantics.lags import Lags
from genpolicy.audit.semantics.lags import episode_lags as piecewise_lags
from genpolicy.audit.semantics.motion import Motion, make_motion
from genpolicy.audit.semantics.report import listed
from genpolicy.audit.semantics.robust import (
    episode_medians,
    group_medians,
    some,
    within_groups,
)
from genpolicy.audit.settings import AuditSettings

# Fewer episodes say nothing about an epoch; each of them is then held against all.
LEAST_EPISODES = 4
# An epoch within this many spreads of single episodes is not off: the lag of an arm depends on how
# it is moved, and so on who moves it.
EPOCH_SPREADS = 2.0
# An episode is off by its own clock beyond this many spreads of its epoch...
EPISODE_SPREADS = 6.0
# ...and this many steps, or, by delays, this many clock limits.
EPISODE_STEPS = 0.75
EPISODE_DELAYS = 2.5
# Two clusters of episodes lie apart by this many of their spreads (an even spread cut in its middle
# by 3.5, the arcsine law by 4.1), and by this many steps: plants differ by less between slow and
# fast motion. Fewer than this share of the episodes are no cluster.
CLUSTER_SPREADS = 4.5
CLUSTER_STEPS = 1.5
CLUSTER_SHARE = 0.1
# A lag this near to the largest that was looked for may be larger.
EDGE_STEPS = 0.5


def episode_lags(data: AuditInput, maximum_rows: int) -> Array:
    """Action-to-state lag of each episode, in steps.

    Returns:
        Shape (E,); NaN where the episode is too short, does not move or does not follow.
    """
    return _lags(make_motion(data), maximum_rows).steps


def position_clocks(data: AuditInput, lags: Array, settings: AuditSettings) -> list[Clock]:
    """The stream of the position, one clock per epoch."""
    known = lags[np.isfinite(lags)]
    reference = settings.declared_lag_rows
    if reference is None:
        reference = float(np.median(known)) if len(known) else 0.0
    delay = data.delay_s.get(data.position_stream)
    same = np.concatenate([[False], data.episode[1:] == data.episode[:-1]])
    spacing = np.abs(np.diff(data.event_time_s, prepend=data.event_time_s[:1]) - data.period_s)
    rows = []
    for epoch in np.unique(data.episodes.calibration_epoch):
        member = (data.episodes.calibration_epoch == epoch) & np.isfinite(lags)
        values = lags[member]
        inside = (data.episodes.calibration_epoch == epoch)[data.episode]
        before, after = _offsets((values - reference) * data.period_s)
        rows.append(
            Clock(
                stream=data.position_stream,
                epoch=str(epoch),
                episodes=len(values),
                offset_before_s=before,
                offset_after_s=after,
                lag_rows=float(np.median(values)) if len(values) else None,
                receive_delay_p50_s=_quantile(delay, inside, 0.5),
                receive_delay_p95_s=_quantile(delay, inside, 0.95),
                jitter_p95_s=_quantile(spacing, inside & same, 0.95),
            )
        )
    return rows


def delay_clocks(data: AuditInput, stream: str, starts: Integers) -> list[Clock]:
    """A stream other than that of the position, by its receive delay; one clock per epoch."""
    delay = data.delay_s[stream]
    medians = episode_medians(delay, starts)
    reference = float(np.median(medians))
    rows = []
    for epoch in np.unique(data.episodes.calibration_epoch):
        member = data.episodes.calibration_epoch == epoch
        inside = member[data.episode]
        # A stream whose clock runs ahead seems to arrive too early: the sign is turned.
        before, after = _offsets(reference - medians[member])
        centre = _quantile(delay, inside, 0.5)
        rows.append(
            Clock(
                stream=stream,
                epoch=str(epoch),
                episodes=int(np.count_nonzero(member)),
                offset_before_s=before,
                offset_after_s=after,
                lag_rows=None if centre is None else centre / data.period_s,
                receive_delay_p50_s=centre,
                receive_delay_p95_s=_quantile(delay, inside, 0.95),
                jitter_p95_s=_quantile(np.abs(delay - (centre or 0.0)), inside, 0.95),
            )
        )
    return rows


def offset_findings(
    stream: str,
    offsets_s: Array,
    data: AuditInput,
    settings: AuditSettings,
    *,
    declared_s: float | None,
    finest_s: float,
    episode_limit_s: float,
    errors_s: Array | None = None,
) -> tuple[list[Finding], Array]:
    """Epochs and single episodes of a stream that are off.

    Args:
        stream: Name of the stream.
        offsets_s: Lag of each episode; NaN where unknown. Shape (E,).
        data: The data.
        settings: Limits.
        declared_s: Lag that the contract states; None takes the median of the episodes.
        finest_s: What the measure resolves.
        episode_limit_s: A single episode is off beyond this.
        errors_s: Standard error of each episode's lag, where it is known. Shape (E,).

    Returns:
        Findings, and the offset to take out of each episode, s. Shape (E,).
    """
    table, findings = data.episodes, []
    taken = np.zeros(len(table))
    deviations, spread = within_groups(offsets_s, table.calibration_epoch, LEAST_EPISODES)
    floor = max(finest_s, settings.clock_floor_s, EPOCH_SPREADS * float(np.nan_to_num(spread)))
    for name, count, gap, error in group_medians(
        offsets_s, table.calibration_epoch, reference=declared_s, least=LEAST_EPISODES
    ):
        limit = max(floor, settings.significance * error)
        member = table.calibration_epoch == name
        if count >= LEAST_EPISODES and not limit - abs(gap) >= 0:
            taken[member] = gap
            findings.append(_epoch_finding(stream, name, gap, limit))
    least = max(episode_limit_s, EPISODE_SPREADS * spread)
    off = np.isfinite(deviations) & (np.abs(np.nan_to_num(deviations)) > least)
    errors = np.zeros(len(table)) if errors_s is None else np.nan_to_num(errors_s)
    own = settings.significance * errors
    off &= np.abs(np.nan_to_num(deviations)) > own
    known = int(np.count_nonzero(np.isfinite(offsets_s)))
    if not findings and not some(off, known, settings.outlier_share):
        # Half of the episodes may be off: then neither half is usual, but there are two.
        least = max(CLUSTER_STEPS * data.period_s, settings.clock_floor_s)
        off, deviations = two_clusters(offsets_s, least)
        off &= np.abs(np.nan_to_num(deviations)) > own
    if some(off, known, settings.outlier_share):
        taken[off] += deviations[off]
        findings.append(_episode_finding(stream, table.uuid[off], deviations[off], known, least))
    return findings, taken


def two_clusters(values: Array, least: float) -> tuple[Flags, Array]:
    """The smaller of two clusters of values, and how far each value lies from the larger.

    Two are seen where the values of each scatter far less than both lie apart: more than the
    halves of any one hill, of an even spread, or of one that crowds at its ends.

    Args:
        values: NaN where unknown. Shape (E,).
        least: Clusters lie at least this far apart.
    """
    known = np.flatnonzero(np.isfinite(values))
    chosen, gaps = np.zeros(len(values), dtype=bool), np.full(len(values), np.nan)
    order = known[np.argsort(values[known], kind="stable")]
    fewest = max(LEAST_EPISODES, int(np.ceil(CLUSTER_SHARE * len(order))))
    best = (0.0, 0)
    ordered = values[order]
    for cut in range(fewest, len(order) - fewest + 1):
        low, high = ordered[:cut], ordered[cut:]
        spread = np.sqrt((low.var() * cut + high.var() * len(high)) / len(ordered))
        apart = float(np.median(high) - np.median(low))
        clear = apart / max(float(spread), 1e-3 * least)
        if apart - least >= 0 and clear > best[0]:
            best = (clear, cut)
    if not best[0] - CLUSTER_SPREADS >= 0:
        return chosen, gaps
    early, late = order[: best[1]], order[best[1] :]
    larger, smaller = (early, late) if len(early) >= len(late) else (late, early)
    chosen[smaller] = True
    gaps[known] = values[known] - np.median(values[larger])
    return chosen, gaps


def shift_rows(taken_s: Array, period_s: float) -> Integers:
    """Offsets as whole rows. Shape (E,)."""
    return np.asarray(np.round(taken_s / period_s), dtype=np.int64)


def leading_findings(lags: Array, data: AuditInput, settings: AuditSettings) -> list[Finding]:
    """A response that comes before its command, everywhere: no arm does that."""
    known = lags[np.isfinite(lags)]
    if settings.declared_lag_rows is not None or len(known) < LEAST_EPISODES:
        return []
    median, limit = (
        float(np.median(known)),
        max(EPISODE_STEPS, settings.clock_floor_s / data.period_s),
    )
    if limit + median >= 0:
        return []
    return [
        Finding(
            kind="clock",
            variable=data.position_stream,
            where="all episodes",
            question="clock_residual_s",
            measured=-median * data.period_s,
            floor=limit * data.period_s,
            unit="s",
            action=f"The observed position moves {-median * data.period_s:.3f} s before its "
            f"command: put stream {data.position_stream} and the actions on one clock, ingest "
            "again and repeat the audit.",
        )
    ]


def _epoch_finding(stream: str, epoch: str, gap_s: float, limit_s: float) -> Finding:
    return Finding(
        kind="clock",
        variable=stream,
        where=f"epoch {epoch or '-'}",
        question="clock_residual_s",
        measured=abs(gap_s),
        floor=limit_s,
        unit="s",
        action=f"Correct the clock of stream {stream} in epoch {epoch or '-'} ({gap_s:+.3f} s), "
        "ingest again and repeat the audit.",
    )


def _episode_finding(
    stream: str, names: Text, deviations_s: Array, known: int, limit_s: float
) -> Finding:
    typical = float(np.median(np.abs(deviations_s)))
    return Finding(
        kind="clock",
        variable=stream,
        where=listed(names),
        question="clock_residual_s",
        measured=typical,
        floor=limit_s,
        unit="s",
        action=f"Correct the clock of stream {stream} in {len(names)} of {known} episodes, which "
        f"stand {typical:.3f} s beside the others ({listed(names)}), or leave them out, and "
        "repeat the audit.",
    )


def _offsets(deviations: Array) -> tuple[float | None, float | None]:
    """Median deviation, and what is left on one half after the other half's is removed."""
    if len(deviations) == 0:
        return None, None
    before = float(np.median(deviations))
    if len(deviations) < 4:
        return before, None
    return before, float(np.median(deviations[1::2]) - np.median(deviations[::2]))


def _quantile(values: Array | None, rows: Flags, share: float) -> float | None:
    if values is None:
        return None
    chosen = values[rows]
    return float(np.quantile(chosen, share)) if len(chosen) else None


def measure_lags(motion: Motion, settings: AuditSettings) -> Lags:
    """Lag of the response behind the command, by episode; further away where some reach on."""
    maximum_rows = settings.maximum_lag_rows
    lags = _lags(motion, maximum_rows)
    edge = np.abs(np.nan_to_num(lags.steps)) >= maximum_rows - EDGE_STEPS
    if some(edge, len(edge), settings.outlier_share):
        return _lags(motion, 2 * maximum_rows)
    return lags


def _lags(motion: Motion, maximum_rows: int) -> Lags:
    return piecewise_lags(
        motion.commanded, motion.observed, motion.starts, motion.pieces, maximum_rows
    )
