"""All measures of data semantics, and the defects in the order of diagnosis."""

import numpy as np

from genpolicy.audit.data import AuditInput
from genpolicy.audit.semantics.calibration import calibrations, start_drift
from genpolicy.audit.semantics.clocks import delay_clocks, episode_lags, position_clocks
from genpolicy.audit.semantics.report import Calibration, Clock, Defect, Semantics, in_order
from genpolicy.audit.settings import AuditSettings

GAP_PERIODS = 1.5


def measure(data: AuditInput, settings: AuditSettings) -> Semantics:
    """Clocks, calibration, gaps and drift of canonical data."""
    lags = episode_lags(data, settings.maximum_lag_steps)
    clocks = [*position_clocks(data, lags, settings)]
    for stream in data.delay_s:
        if stream != data.position_stream:
            clocks += delay_clocks(data, stream)
    steps = np.diff(data.event_time_s)[data.episode[1:] == data.episode[:-1]]
    found = calibrations(data, settings)
    negative = sum(
        int(np.count_nonzero(delay < -settings.negative_delay_tolerance_s))
        for delay in data.delay_s.values()
    )
    return Semantics(
        clocks=tuple(clocks),
        calibrations=found,
        gaps=int(np.count_nonzero(steps > GAP_PERIODS * data.period_s)),
        negative_delays=negative,
        start_drift=start_drift(data),
        defects=in_order(
            [
                *_offsets(clocks, settings),
                *_negative(negative),
                *_shifted(found, settings),
            ]
        ),
    )


def _offsets(clocks: list[Clock], settings: AuditSettings) -> list[Defect]:
    result = []
    for clock in clocks:
        offset = clock.offset_before_s
        if offset is not None and not settings.clock_limit_s - abs(offset) >= 0:
            result.append(
                Defect(
                    "clock",
                    clock.stream,
                    f"epoch {clock.epoch or '-'}",
                    abs(offset),
                    settings.clock_limit_s,
                    "s",
                    f"Correct the clock of stream {clock.stream} in epoch {clock.epoch or '-'} "
                    f"({offset:+.3f} s), ingest again and repeat the audit.",
                )
            )
    return result


def _negative(negative: int) -> list[Defect]:
    if not negative:
        return []
    action = (
        f"{negative} samples were received before they happened: put both times on one clock and "
        "ingest again."
    )
    return [Defect("clock", "", "receive times", float(negative), 0.0, "samples", action)]


def _shifted(found: tuple[Calibration, ...], settings: AuditSettings) -> list[Defect]:
    result = []
    for row in found:
        known = row.residual_m == row.residual_m
        if known and not settings.calibration_limit_m - row.residual_m >= 0:
            result.append(
                Defect(
                    "calibration",
                    row.epoch,
                    f"epoch {row.epoch}",
                    row.residual_m,
                    settings.calibration_limit_m,
                    "m",
                    f"Recalibrate or leave out epoch {row.epoch}: its releases lie "
                    f"{row.residual_m * 1e3:.1f} mm from those of the others.",
                )
            )
    return result
