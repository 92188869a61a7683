"""Clock drift: a lag that grows along an episode, or changes over the recordings.

Along an episode the lag of the first half of the motion is held against that of the second half;
over the recordings the lags are cut in two at the place that separates them best.
"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Integers
from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.clocks import EPOCH_SPREADS, LEAST_EPISODES
from genpolicy.audit.semantics.lags import segment_lags
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.robust import (
    densest_half,
    episode_sums,
    group_medians,
    within_groups,
)
from genpolicy.audit.settings import AuditSettings

# A change over the recordings must stand out of the changes between neighbours this much: the best
# of many cuts is taken, and operators take turns.
CUT_ERRORS = 6.0
# ...and so must be more than operators and their ways make of it.
CUT_SPREADS = 3.0
LEAST_SIDE = 8
# The spread of lags from one recording to the next is not believed below this, steps.
FINEST_STEPS = 0.02
# The growth of a lag is carried on over this many times the rows in which the arm moves.
CARRIED_ON = 1.25


def episode_drifts(motion: Motion, lags: Array, settings: AuditSettings) -> Array:
    """Growth of the lag from the first to the last row of each episode, steps. Shape (E,)."""
    count = len(motion.starts) - 1
    result = np.full(count, np.nan)
    if motion.commanded.shape[1] == 0:
        return result
    cut, distance, ends = _halves(motion)
    extent = np.diff(ends, axis=1)[:, 0]
    # A wait shows no lag and would only change the means that the halves are taken about.
    reach = settings.maximum_lag_rows
    begin = np.clip(ends[:, 0] - reach, motion.starts[:-1], cut)
    end = np.clip(ends[:, 1] + reach, cut, motion.starts[1:])
    edges = np.stack([motion.starts[:-1], begin, cut, end], axis=1).ravel()
    edges = np.append(edges, motion.starts[-1])
    halves = segment_lags(
        motion.commanded, motion.observed, edges, settings.maximum_lag_rows
    ).steps.reshape(count, 4)[:, 1:3]
    whole = np.isin(
        motion.starts[1:], motion.pieces[1:][np.isin(motion.pieces[:-1], motion.starts)]
    )
    known = whole & np.isfinite(lags) & np.isfinite(halves).all(axis=1) & (distance >= 4.0)
    # While an arm waits its lag is not seen: what is seen is not carried on over long waits.
    length = np.minimum(np.diff(motion.starts), CARRIED_ON * extent)
    growth = (halves[known, 1] - halves[known, 0]) * (length[known] / distance[known])
    result[known] = growth
    return result


def drift_findings(drifts: Array, data: AuditInput, settings: AuditSettings) -> list[Finding]:
    """Drift along the episodes of an epoch, from the growth of the lag."""
    findings = []
    _, spread = within_groups(drifts, data.episodes.calibration_epoch, LEAST_EPISODES)
    floor = max(settings.drift_floor_rows, settings.clock_floor_s / data.period_s)
    floor = max(floor, EPOCH_SPREADS * float(np.nan_to_num(spread)))
    for name, count, growth, error in group_medians(
        drifts, data.episodes.calibration_epoch, reference=0.0, least=LEAST_EPISODES
    ):
        limit = max(floor, settings.significance * error)
        if count >= LEAST_EPISODES and not limit - abs(growth) >= 0:
            findings.append(
                Finding(
                    kind="clock_drift",
                    variable=data.position_stream,
                    where=f"epoch {name or '-'}",
                    question="lag_drift_rows",
                    measured=abs(growth),
                    floor=limit,
                    unit="steps per episode",
                    action=f"The lag of stream {data.position_stream} behind the actions changes "
                    f"by {growth * data.period_s:+.3f} s within an episode of epoch "
                    f"{name or '-'}: put both on one clock, ingest again and repeat the audit.",
                )
            )
    return findings


def delay_drift_findings(
    stream: str, data: AuditInput, starts: Integers, settings: AuditSettings
) -> list[Finding]:
    """Drift of a stream's clock along the episodes, from the growth of its receive delay."""
    length = np.diff(starts)
    centred = np.arange(len(data.episode)) - np.repeat(starts[:-1] + (length - 1) / 2, length)
    power = episode_sums(np.asarray(centred**2, dtype=np.float64), starts)
    slope = episode_sums(centred * data.delay_s[stream], starts) / np.maximum(power, 1.0)
    growth = np.where(length >= LEAST_SIDE, slope * length, np.nan)
    findings = []
    for name, count, gap, error in group_medians(
        growth, data.episodes.calibration_epoch, reference=0.0, least=LEAST_EPISODES
    ):
        limit = max(settings.clock_floor_s, settings.significance * error)
        if count >= LEAST_EPISODES and not limit - abs(gap) >= 0:
            findings.append(
                Finding(
                    kind="clock_drift",
                    variable=stream,
                    where=f"epoch {name or '-'}",
                    question="clock_residual_s",
                    measured=abs(gap),
                    floor=limit,
                    unit="s per episode",
                    action=f"The receive delay of stream {stream} changes by {gap:+.3f} s within "
                    f"an episode of epoch {name or '-'}: its clock runs at another rate; "
                    "synchronise it, ingest again and repeat the audit.",
                )
            )
    return findings


def order_findings(
    stream: str, offsets_s: Array, data: AuditInput, settings: AuditSettings, *, limit_s: float
) -> list[Finding]:
    """A change of a stream's lag over the recordings."""
    order = data.episodes.order
    known = np.flatnonzero(np.isfinite(offsets_s) & np.isfinite(order))
    if len(known) < 4 * LEAST_SIDE:
        return []
    ordered = known[np.argsort(order[known])]
    values = offsets_s[ordered]
    centre, spread = densest_half(values)
    floor = FINEST_STEPS * data.period_s
    noise = max(densest_half(np.diff(values))[1] / np.sqrt(2.0), floor)
    # A few wild episodes are another matter.
    wide = 6.0 * max(spread, limit_s)
    kept = np.clip(values, centre - wide, centre + wide)
    cut, change, error = _best_cut(kept)
    trend = np.polyfit(np.arange(len(kept)), kept, 1)
    if float(np.sum((kept - np.polyval(trend, np.arange(len(kept)))) ** 2)) < error:
        change = float(trend[0]) * (len(kept) - 1)
    deviation = noise * np.sqrt(1.0 / cut + 1.0 / (len(kept) - cut))
    limit = max(limit_s, CUT_SPREADS * noise, CUT_ERRORS * float(deviation))
    if limit - abs(change) >= 0:
        return []
    first = str(data.episodes.uuid[ordered[cut]])
    return [
        Finding(
            kind="clock_drift",
            variable=stream,
            where=f"from episode {first} on, in order of recording",
            question="clock_residual_s",
            measured=abs(change),
            floor=limit,
            unit="s",
            action=f"The lag of stream {stream} changes by {change:+.3f} s over the recordings, "
            f"most about episode {first}: put its clock right from there on, ingest again and "
            "repeat the audit.",
        )
    ]


def _halves(motion: Motion) -> tuple[Integers, Array, Integers]:
    """First row of the second half of each episode's motion, the rows between both, and its ends.

    It begins and ends with the first and the last twentieth of the way. Ends: shape (E, 2).
    """
    scale = np.std(motion.commanded, axis=0)
    steps = np.abs(np.diff(motion.commanded, axis=0, prepend=motion.commanded[:1]))
    length = np.diff(motion.starts)
    first = motion.starts[:-1][length > 0]
    steps[first] = 0.0
    travel = steps @ (1.0 / np.where(scale > 0, scale, np.inf))
    gone = np.cumsum(travel)
    begin = np.concatenate([[0.0], gone])[motion.starts[:-1]]
    total = episode_sums(travel, motion.starts)
    rows = np.arange(len(travel))
    share = gone - np.repeat(begin, length)
    later = share >= np.repeat(0.5 * total, length)
    before = [
        episode_sums((share < np.repeat(part * total, length)).astype(np.float64), motion.starts)
        for part in (0.05, 0.95)
    ]
    weight = episode_sums(np.where(later, travel, 0.0), motion.starts)
    late = episode_sums(np.where(later, travel * rows, 0.0), motion.starts)
    early = episode_sums(np.where(later, 0.0, travel * rows), motion.starts)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.nan_to_num(late / weight - early / (total - weight), posinf=0.0, neginf=0.0)
    cut = motion.starts[1:] - episode_sums(later.astype(np.float64), motion.starts).astype(int)
    ends = motion.starts[:-1, None] + np.stack(before, axis=1).astype(np.int64)
    return np.asarray(cut, dtype=np.int64), distance, ends


def _best_cut(values: Array) -> tuple[int, float, float]:
    """Where two sides differ most for their size, by how much, and the squares left beside them."""
    n = len(values)
    before = np.cumsum(values)[LEAST_SIDE - 1 : n - LEAST_SIDE]
    sizes = np.arange(LEAST_SIDE, n - LEAST_SIDE + 1)
    gaps = (values.sum() - before) / (n - sizes) - before / sizes
    gained = gaps**2 * sizes * (n - sizes) / n
    best = int(np.argmax(gained))
    left = float(np.sum((values - values.mean()) ** 2) - gained[best])
    return int(sizes[best]), float(gaps[best]), left
