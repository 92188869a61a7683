"""An observation as it is told: whatever its time, phase and distance are, reading never raises."""

import math
import sys
from dataclasses import dataclass
from numbers import Real

import numpy as np

from genpolicy.execution.moment import Position, View
from genpolicy.execution.nanoseconds import ns_or_none

FARTHEST_M = sys.float_info.max


@dataclass(frozen=True, slots=True)
class Observed:
    """One observation, read.

    Attributes:
        event_ns: When its newest sensor was exposed; after now where that is no time.
        phase: Task phase; empty where it is no name, and then nothing is allowed.
        calibration_epoch: Calibration of its sensors; the same.
        ignored: Why it is not used; empty where it is.
        divergence_m: Distance of measured from commanded TCP; None where nobody says, and what is
            said and is no distance is the largest that there is.
        tcp_m: Where the TCP was measured, m; None where nobody says, or says no place.
    """

    event_ns: int
    phase: str
    calibration_epoch: str
    ignored: str
    divergence_m: float | None = None
    tcp_m: Position | None = None

    @classmethod
    def of(  # noqa: PLR0917
        cls,
        view: View,
        now_ns: int,
        event_time_s: object,
        phase: object,
        epoch: object,
        divergence_m: object = None,
        tcp_m: object = None,
    ) -> "Observed":
        """What is told now, seen from a view of the present."""
        told_ns = ns_or_none(event_time_s)
        event_ns = now_ns + 1 if told_ns is None else told_ns
        ignored = view.ignores(event_ns, now_ns)
        return cls(
            event_ns, name_of(phase), name_of(epoch), ignored, distance_of(divergence_m),
            position_of(tcp_m),
        )  # fmt: skip

    def payload(self) -> dict[str, object]:
        """For the journal."""
        return {
            "event_time_ns": self.event_ns, "phase": self.phase,
            "calibration_epoch": self.calibration_epoch, "used": not self.ignored,
            "ignored_because": self.ignored, "divergence_m": self.divergence_m,
            "tcp_m": list(self.tcp_m or ()),
        }  # fmt: skip


def distance_of(value: object) -> float | None:
    """A distance, m; the largest there is of what is said and is none, None where nothing is."""
    if value is None:
        return None
    try:
        told_m = float(value) if isinstance(value, Real) else math.nan
    except Exception:  # of whatever it is, reading it may raise anything
        return FARTHEST_M
    return told_m if 0.0 <= told_m <= FARTHEST_M else FARTHEST_M


def position_of(value: object) -> Position | None:
    """A place, m; None of what is none, or cannot be read."""
    if value is None:
        return None
    try:
        x, y, z = (float(part) for part in np.asarray(value, dtype=np.float64))
    except Exception:  # of whatever it is, reading it may raise anything
        return None
    return (x, y, z) if all(map(math.isfinite, (x, y, z))) else None


def name_of(value: object) -> str:
    """A name, as it is and as a plain text; what is none, or cannot be read, names nothing."""
    try:
        return str.__str__(value) if isinstance(value, str) else ""
    except Exception:  # of whatever it is, asking what it is may raise anything
        return ""
