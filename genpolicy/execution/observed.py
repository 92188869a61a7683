"""An observation as it is told: whatever its time, phase and distance are, reading never raises."""

from dataclasses import dataclass
from numbers import Real

from genpolicy.execution.moment import View
from genpolicy.execution.nanoseconds import ns_or_none


@dataclass(frozen=True, slots=True)
class Observed:
    """One observation, read.

    Attributes:
        event_ns: When its newest sensor was exposed; after now where that is no time.
        phase: Task phase; empty where it is no name, and then nothing is allowed.
        calibration_epoch: Calibration of its sensors; the same.
        ignored: Why it is not used; empty where it is.
    """

    event_ns: int
    phase: str
    calibration_epoch: str
    ignored: str

    @classmethod
    def of(
        cls, view: View, now_ns: int, event_time_s: object, phase: object, epoch: object
    ) -> "Observed":
        """What is told now, seen from a view of the present."""
        told_ns = ns_or_none(event_time_s)
        event_ns = now_ns + 1 if told_ns is None else told_ns
        return cls(event_ns, name_of(phase), name_of(epoch), view.ignores(event_ns, now_ns))

    def payload(self) -> dict[str, object]:
        """For the journal."""
        return {
            "event_time_ns": self.event_ns, "phase": self.phase,
            "calibration_epoch": self.calibration_epoch, "used": not self.ignored,
            "ignored_because": self.ignored,
        }  # fmt: skip


def too_far(divergence_m: float | None, limit_m: float) -> bool:
    """Whether the arm is not where it was sent; what is no distance is too far, None is unknown."""
    if divergence_m is None:
        return False
    return not (isinstance(divergence_m, Real) and 0.0 <= divergence_m <= limit_m)


def name_of(value: object) -> str:
    """A name, as it is; what is none names nothing."""
    return value if isinstance(value, str) else ""
