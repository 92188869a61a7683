"""What the layer of data semantics says: clocks, calibration, and what stands out of the noise."""

from dataclasses import dataclass, field

import numpy as np

from genpolicy.audit.data import Integers, Text
from genpolicy.audit.rows import Calibration, Clock, Finding

# In the order of diagnosis. A stream that stands still makes all that is measured of its motion
# wrong, and is seen whatever its unit. Units and frames are measured whatever the lag is, but a lag
# is not worth much in a turned frame: so they stand before clocks.
KINDS = (
    "frozen", "unit", "swapped_columns", "frame", "clock", "rate", "jitter", "gaps", "clock_drift",
    "glued", "duplicate", "stub", "calibration",
)  # fmt: skip


@dataclass(frozen=True)
class Semantics:
    """All of it, and numbers for the summary.

    Attributes:
        clocks: One per stream and epoch.
        calibrations: One per epoch.
        gaps: Rows that follow a gap in time.
        start_drift: Largest difference of the median start position between training and held-out
            episodes, unit of the position.
        findings: Deviations beyond the noise, in the order of diagnosis.
        notes: Sentences on what is worth knowing and no deviation.
        shift_rows: By how many rows the commands of each episode are to be moved so that all
            episodes are aligned. Shape (E,).
        stream_shift_rows: The same for the columns of each other stream that was measured.
        untold_freezes: Streams that stand still for long in most episodes.
        unclocked: Streams whose clock could not be looked at, neither by delay nor by motion.
    """

    clocks: tuple[Clock, ...]
    calibrations: tuple[Calibration, ...]
    gaps: int
    start_drift: float
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()
    shift_rows: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    stream_shift_rows: dict[str, Integers] = field(default_factory=dict)
    unclocked: tuple[str, ...] = ()
    untold_freezes: tuple[str, ...] = ()


def in_order(findings: list[Finding]) -> tuple[Finding, ...]:
    """In the order of diagnosis."""
    return tuple(sorted(findings, key=lambda finding: KINDS.index(finding.kind)))


def listed(names: Text) -> str:
    """The first names, and how many more."""
    shown = ", ".join(str(name) for name in names[:3])
    return shown + (f" and {len(names) - 3} more" if len(names) > 3 else "")
