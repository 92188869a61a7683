"""Rows of the two clocks: what each did with the same recorded windows."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ClockInvocationRow:
    """`invocations.parquet` of wall_clock: one invocation of a window, by one of the two clocks.

    Attributes:
        method: The method.
        clock: `wall` or `virtual`.
        episode: The held-out episode that the window is of; the unit of independence.
        invocation: Count in this window; 0 is the first after a start and is compared with nothing.
        in_time: Whether it began early enough for its deadline to lie within the window.
        missed: Whether its deadline passed.
        discarded_by: Why its chunk was discarded before any action of it; empty where it was not.
        replaced: Whether the rest of its chunk gave way to what came next.
    """

    method: str
    clock: str
    episode: str
    invocation: int
    in_time: bool
    missed: bool
    discarded_by: str
    replaced: bool


@dataclass(frozen=True)
class ClockAgeRow:
    """`ages.parquet` of wall_clock: one action that the stub accepted.

    Attributes:
        method: The method.
        clock: `wall` or `virtual`.
        episode: The held-out episode.
        invocation: Count in this window.
        row: Row of its chunk.
        age_s: Accept minus observation event, s.
    """

    method: str
    clock: str
    episode: str
    invocation: int
    row: int
    age_s: float


@dataclass(frozen=True)
class ClockTickRow:
    """`ticks.parquet` of wall_clock: how one clock ticked in one window.

    Attributes:
        method: The method.
        clock: `wall` or `virtual`.
        episode: The held-out episode.
        ticks: So many; a row of the recording without one went by.
        late_p95_s: 95 % quantile of how far a tick lay from a whole period, s.
        late_max_s: The most, s.
    """

    method: str
    clock: str
    episode: str
    ticks: int
    late_p95_s: float
    late_max_s: float
