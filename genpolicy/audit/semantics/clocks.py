"""Clocks and lag: is what looks like two modes only a shift in time?

The action-to-state lag is measured per episode by the shift that brings the observed position
closest to the commanded one. An epoch that deviates from the declared lag has a clock or a
frame defect. Streams without motion are judged by their receive delay.
"""

from itertools import pairwise

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.semantics.report import Clock
from genpolicy.audit.settings import AuditSettings


def episode_lags(data: AuditInput, maximum_steps: int) -> Array:
    """Action-to-state lag of each episode, in steps, by least squares with a parabola.

    Returns:
        Shape (E,); NaN where the episode is too short or does not move.
    """
    shifts = np.arange(-maximum_steps, maximum_steps + 1)
    result = np.full(len(data.episodes), np.nan)
    starts = np.searchsorted(data.episode, np.arange(len(data.episodes) + 1))
    commanded, observed = data.action[:, data.action_position], data.position
    for number in range(len(data.episodes)):
        a = commanded[starts[number] : starts[number + 1]]
        o = observed[starts[number] : starts[number + 1]]
        if len(a) < 2 * maximum_steps + 8 or float(np.ptp(a, axis=0).max()) <= 0.0:
            continue
        errors = np.array([_shift_error(a, o, int(shift)) for shift in shifts])
        result[number] = _vertex(shifts, errors)
    return result


def position_clocks(data: AuditInput, lags: Array, settings: AuditSettings) -> list[Clock]:
    """The stream of the position, one clock per epoch."""
    known = lags[np.isfinite(lags)]
    reference = settings.declared_lag_steps
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
                lag_steps=float(np.median(values)) if len(values) else None,
                receive_delay_p50_s=_quantile(delay, inside, 0.5),
                receive_delay_p95_s=_quantile(delay, inside, 0.95),
                jitter_p95_s=_quantile(spacing, inside & same, 0.95),
            )
        )
    return rows


def delay_clocks(data: AuditInput, stream: str) -> list[Clock]:
    """A stream without motion of its own, by its receive delay; one clock per epoch."""
    delay = data.delay_s[stream]
    medians = _episode_medians(data, delay)
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
                lag_steps=None if centre is None else centre / data.period_s,
                receive_delay_p50_s=centre,
                receive_delay_p95_s=_quantile(delay, inside, 0.95),
                jitter_p95_s=_quantile(np.abs(delay - (centre or 0.0)), inside, 0.95),
            )
        )
    return rows


def _offsets(deviations: Array) -> tuple[float | None, float | None]:
    """Median deviation, and what is left on one half after the other half's is removed."""
    if len(deviations) == 0:
        return None, None
    before = float(np.median(deviations))
    if len(deviations) < 4:
        return before, None
    return before, float(np.median(deviations[1::2]) - np.median(deviations[::2]))


def _episode_medians(data: AuditInput, values: Array) -> Array:
    starts = np.searchsorted(data.episode, np.arange(len(data.episodes) + 1))
    return np.array([np.median(values[a:b]) for a, b in pairwise(starts)])


def _shift_error(commanded: Array, observed: Array, shift: int) -> float:
    """Variance of observed[t + shift] - commanded[t]; a constant frame offset does not count."""
    n = len(commanded)
    if shift >= 0:
        gap = observed[shift:] - commanded[: n - shift]
    else:
        gap = observed[: n + shift] - commanded[-shift:]
    return float(np.mean((gap - gap.mean(axis=0)) ** 2))


def _vertex(shifts: Integers, errors: Array) -> float:
    best = int(np.argmin(errors))
    if best in (0, len(errors) - 1):
        return float(shifts[best])
    left, centre, right = errors[best - 1 : best + 2]
    bend = left - 2 * centre + right
    return float(shifts[best] + (0.5 * (left - right) / bend if bend > 0 else 0.0))


def _quantile(values: Array | None, rows: Flags, share: float) -> float | None:
    if values is None:
        return None
    chosen = values[rows]
    return float(np.quantile(chosen, share)) if len(chosen) else None
