"""What the layer of data semantics says: clocks, calibration, and what stands out of the noise."""

from dataclasses import dataclass, field

import numpy as np

from genpolicy.audit.data import Integers, Text

# In the order of diagnosis. Units and frames are measured
# whatever the lag is, but a lag is not worth much in a turned frame: so they stand before clocks.
KINDS = (
    "unit", "swapped_columns", "frame", "clock", "rate", "jitter", "gaps", "clock_drift", "glued",
    "duplicate", "stub", "calibration",
)  # fmt: skip


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
class Finding:
    """One deviation that stands out of the noise; whether it is a fault, a limit says elsewhere.

    Attributes:
        kind: One of `KINDS`.
        variable: What it is a fault of: a stream, an epoch or a component.
        where: Which episodes, epochs or rows.
        question: Which limit it is to be held against.
        measured: The number.
        floor: From where on it is reported: what noise explains, or the floor of the settings.
        unit: Unit of both.
        action: What to do about it, a sentence.
    """

    kind: str
    variable: str
    where: str
    question: str
    measured: float
    floor: float
    unit: str
    action: str


@dataclass(frozen=True)
class Semantics:
    """All of it, and numbers for the summary.

    Attributes:
        clocks: One per stream and epoch.
        calibrations: One per epoch.
        gaps: Rows that follow a gap in time.
        negative_delays: Samples received before they happened, beyond the tolerance.
        start_drift: Largest difference of the median start position between training and held-out
            episodes, unit of the position.
        findings: Deviations beyond the noise, in the order of diagnosis.
        notes: Sentences on what is worth knowing and no deviation.
        shift_steps: By how many rows the commands of each episode are to be moved so that all
            episodes are aligned. Shape (E,).
        stream_shift_steps: The same for the columns of each other stream that was measured.
        unclocked: Streams whose clock could not be looked at, neither by delay nor by motion.
    """

    clocks: tuple[Clock, ...]
    calibrations: tuple[Calibration, ...]
    gaps: int
    negative_delays: int
    start_drift: float
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()
    shift_steps: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    stream_shift_steps: dict[str, Integers] = field(default_factory=dict)
    unclocked: tuple[str, ...] = ()


def in_order(findings: list[Finding]) -> tuple[Finding, ...]:
    """In the order of diagnosis."""
    return tuple(sorted(findings, key=lambda finding: KINDS.index(finding.kind)))


def listed(names: Text) -> str:
    """The first names, and how many more."""
    shown = ", ".join(str(name) for name in names[:3])
    return shown + (f" and {len(names) - 3} more" if len(names) > 3 else "")
