"""Time in whole nanoseconds: `n * 0.05` is no multiple of 0.05 in floating point, in ns it is."""

from dataclasses import dataclass
from numbers import Real

from genpolicy.contract.chunk import ChunkMetadata
from genpolicy.errors import NonFiniteError

NS_PER_S = 1_000_000_000
NEVER_NS = -(1 << 62)


def ns_or_none(time_s: object) -> int | None:
    """Whole nanoseconds of a time in s; None of what is no time, whatever it is."""
    try:
        if isinstance(time_s, bool) or not isinstance(time_s, Real):
            return None
        scaled = float(time_s) * NS_PER_S
    except Exception:  # of whatever it is, reading it may raise anything
        return None
    return round(scaled) if abs(scaled) < -NEVER_NS else None


def to_ns(time_s: float) -> int:
    """Whole nanoseconds of a time in s.

    Raises:
        NonFiniteError: No number, NaN, infinite, or more than a century from the clock's zero.
    """
    time_ns = ns_or_none(time_s)
    if time_ns is None:
        raise NonFiniteError(
            where="a time",
            found=f"{time_s!r:.40}",
            expected="finite, s",
            action="Hold; fix the clock.",
        )
    return time_ns


@dataclass(frozen=True, slots=True)
class ChunkTimes:
    """The times of a chunk in ns."""

    condition_ns: int
    start_ns: int
    period_ns: int
    valid_until_ns: int

    @classmethod
    def of(cls, metadata: ChunkMetadata) -> "ChunkTimes":
        """Times of a chunk.

        Raises:
            NonFiniteError: A time is too large to be one.
        """
        return cls(
            condition_ns=to_ns(metadata.condition_observation_event_time_s),
            start_ns=to_ns(metadata.action_start_time_s),
            period_ns=to_ns(metadata.action_period_s),
            valid_until_ns=to_ns(metadata.valid_until_s),
        )

    def due_ns(self, row: int) -> int:
        """Begin of a row's window."""
        return self.start_ns + row * self.period_ns
