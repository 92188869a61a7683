"""Clocks, lag and calibration: is what looks like two modes only misaligned data?

The action-to-state lag is measured per episode by the shift that brings the observed position
closest to the commanded one. An epoch that deviates from the declared lag has a clock or a
frame defect. Streams without motion are judged by their receive delay.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.settings import AuditSettings

GAP_PERIODS = 1.5


@dataclass(frozen=True)
class Clock:
    """One stream in one calibration epoch; unknown numbers are None.

    Attributes:
        stream: Name of the stream.
        epoch: Calibration epoch.
        episodes: Episodes measured.
        offset_before_s: Deviation from the declared alignment.
        offset_after_s: What is left after realignment, measured on the other half of the episodes.
        lag_steps: Action-to-state lag for the stream of the position; for the others the median
            receive delay, in action steps.
        receive_delay_p50_s: Median receive delay.
        receive_delay_p95_s: 95 % quantile of the receive delay.
        jitter_p95_s: 95 % quantile of the deviation from the period (position) or from the median
            delay (others).
    """

    stream: str
    epoch: str
    episodes: int
    offset_before_s: float | None
    offset_after_s: float | None
    lag_steps: float | None
    receive_delay_p50_s: float | None
    receive_delay_p95_s: float | None
    jitter_p95_s: float | None


@dataclass(frozen=True)
class Calibration:
    """Residual of one epoch: how far its releases lie from those of the others, m."""

    epoch: str
    episodes: int
    residual_m: float


@dataclass(frozen=True)
class Semantics:
    """All of it, and two numbers for the summary.

    Attributes:
        clocks: One per stream and epoch.
        calibrations: One per epoch.
        gaps: Rows that follow a gap in time.
        negative_delays: Samples received before they happened, beyond the tolerance.
        start_drift: Largest difference of the median start position between training and held-out
            episodes, unit of the position.
    """

    clocks: tuple[Clock, ...]
    calibrations: tuple[Calibration, ...]
    gaps: int
    negative_delays: int
    start_drift: float


def measure(data: AuditInput, settings: AuditSettings) -> Semantics:
    """Clocks, calibration, gaps and drift of canonical data."""
    lags = episode_lags(data, settings.maximum_lag_steps)
    clocks = [*_position_clocks(data, lags, settings)]
    for stream in data.delay_s:
        if stream != data.position_stream:
            clocks += _delay_clocks(data, stream)
    steps = np.diff(data.event_time_s)[data.episode[1:] == data.episode[:-1]]
    return Semantics(
        clocks=tuple(clocks),
        calibrations=_calibrations(data, settings),
        gaps=int(np.count_nonzero(steps > GAP_PERIODS * data.period_s)),
        negative_delays=sum(
            int(np.count_nonzero(delay < -settings.negative_delay_tolerance_s))
            for delay in data.delay_s.values()
        ),
        start_drift=_start_drift(data),
    )


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


def realigned(data: AuditInput, clocks: tuple[Clock, ...]) -> tuple[AuditInput, bool]:
    """Actions moved by the whole steps by which their epoch's position stream is off.

    Returns:
        The data and whether anything moved.
    """
    shift = np.zeros(len(data.episodes), dtype=np.int64)
    for clock in clocks:
        if clock.stream == data.position_stream and clock.offset_before_s is not None:
            steps = round(clock.offset_before_s / data.period_s)
            shift[data.episodes.calibration_epoch == clock.epoch] = steps
    if not shift.any():
        return data, False
    rows = np.arange(len(data.action)) - shift[data.episode]
    rows = np.clip(rows, data.first_row, data.last_row)
    return replace(data, action=data.action[rows]), True


def _position_clocks(data: AuditInput, lags: Array, settings: AuditSettings) -> list[Clock]:
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


def _delay_clocks(data: AuditInput, stream: str) -> list[Clock]:
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


def _calibrations(data: AuditInput, settings: AuditSettings) -> tuple[Calibration, ...]:
    if data.reference is None:
        return ()
    releases = _first_rows(data, settings.calibration_phase)
    releases = releases[data.episodes.outcome[data.episode[releases]] == "success"]
    releases = releases[~data.episodes.is_recovery[data.episode[releases]]]
    start = data.reference.start
    planar = slice(start, min(data.reference.stop, start + 2))
    residual = data.position[releases][:, :2] - data.observation[releases][:, planar]
    epochs = data.episodes.calibration_epoch[data.episode[releases]]
    names = np.unique(data.episodes.calibration_epoch)
    medians = {
        str(name): np.median(residual[epochs == name], axis=0)
        for name in names
        if np.any(epochs == name)
    }
    return tuple(
        Calibration(
            epoch=str(name),
            episodes=int(np.count_nonzero(epochs == name)),
            residual_m=_epoch_residual(str(name), medians),
        )
        for name in names
    )


def _epoch_residual(name: str, medians: dict[str, Array]) -> float:
    """Distance to the median epoch; with two epochs to the other one; NaN without a release."""
    if name not in medians:
        return float("nan")
    others = [value for key, value in medians.items() if key != name]
    if not others:
        return 0.0
    pool = others if len(medians) == 2 else list(medians.values())
    return float(np.linalg.norm(medians[name] - np.median(np.stack(pool), axis=0)))


def _start_drift(data: AuditInput) -> float:
    first = data.position[np.unique(data.first_row)]
    training = data.episodes.split == "train"
    if training.all() or not training.any():
        return 0.0
    gap = np.median(first[training], axis=0) - np.median(first[~training], axis=0)
    return float(np.max(np.abs(gap)))


def _first_rows(data: AuditInput, phase: str) -> Integers:
    rows = np.flatnonzero(data.phase == phase)
    _, first = np.unique(data.episode[rows], return_index=True)
    return np.asarray(rows[first], dtype=np.int64)


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
