"""Rows of monitors: scores of invocations, thresholds, and what each monitor said of a rollout."""

from dataclasses import dataclass


@dataclass(frozen=True)
class MonitorScoreRow:
    """`scores.parquet` of monitors: one invocation, scored by one monitor.

    Attributes:
        method: The method.
        condition: `thresholds`, `judged`, or a family of probes and its severity.
        start: Number of the initial state within its condition.
        invocation: Count in this rollout, from 0.
        time_s: When it began, s.
        phase: Task phase then.
        monitor: Who scored.
        score: Higher is further out.
    """

    method: str
    condition: str
    start: int
    invocation: int
    time_s: float
    phase: str
    monitor: str
    score: float


@dataclass(frozen=True)
class MonitorThresholdRow:
    """`thresholds.parquet` of monitors: above which score a monitor raises an alarm in a phase.

    Attributes:
        method: The method.
        monitor: The monitor.
        phase: Task phase.
        alpha: Chance of an alarm in the phase of a successful nominal episode, at most.
        episodes: Successful episodes that came through the phase; each gives its largest score.
        rank: Rank of the threshold among them, from 1.
        threshold: The score of that rank; None where there are too few episodes for alpha, and
            then there is no alarm.
    """

    method: str
    monitor: str
    phase: str
    alpha: float
    episodes: int
    rank: int
    threshold: float | None


@dataclass(frozen=True)
class MonitorAlarmRow:
    """`alarms.parquet` of monitors: one phase of one rollout under one monitor.

    Attributes:
        method: The method.
        monitor: The monitor.
        family: Family of probes, or `nominal`.
        severity: Severity of the probe; 0 of `nominal`.
        start: Number of the initial state within its condition.
        phase: A phase that the rollout came through.
        score_max: Largest score in it from the onset on; None where the onset was later.
        alarm: Whether a score in it exceeded the threshold from the onset on.
        first_alarm_s: The first such, s; None without one.
        onset_s: From when on the probe can be felt, s; None where the rollout never got there.
        delay_s: First alarm minus onset, s.
        outcome: How the rollout ended.
        success: Whether it succeeded.
        recovery_attempted: Whether a recovery began.
        recovered: Whether it succeeded after one.
        duration_s: How long it took, s.
    """

    method: str
    monitor: str
    family: str
    severity: float
    start: int
    phase: str
    score_max: float | None
    alarm: bool
    first_alarm_s: float | None
    onset_s: float | None
    delay_s: float | None
    outcome: str
    success: bool
    recovery_attempted: bool
    recovered: bool
    duration_s: float


@dataclass(frozen=True)
class MonitorUnavailableRow:
    """`unavailable.parquet` of monitors: a monitor that cannot watch a method, or failed.

    Attributes:
        method: The method.
        monitor: The monitor.
        why: Why not.
    """

    method: str
    monitor: str
    why: str
