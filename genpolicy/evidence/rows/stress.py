"""Rows of stress: rollouts, the stub, ages and the balance of actions."""

from dataclasses import dataclass

SEVERITIES = "severities.parquet"
"""Beside the rollouts where a curve is planned, and only there."""


@dataclass(frozen=True)
class RolloutRow:
    """`rollouts.parquet` of stress: one rollout.

    Attributes:
        method: The method.
        seed: Number of its training seed.
        perturbation: What was injected.
        start: Number of the initial state.
        start_sha256: Hash of the state after reset.
        outcome: How it ended.
        success: Whether it succeeded.
        duration_s: Virtual time, s.
        ticks: Ticks of it.
        action_ticks: Ticks with an action of the policy.
        hold_ticks: Ticks that held.
        fallback_ticks: Ticks with an action of the fallback.
        invocations: Invocations begun.
        deadline_misses: Of these, not answered by their deadline.
        discards: Actions discarded.
        rejections: Invocations of which no candidate passed.
        rejected_by: Most common reason; empty where none was rejected.
        recovery_attempted: Whether a recovery began.
        recovered: Whether the last one counts as recovered (`RecoveryRow`).
        interventions: Calls for a person.
        person_s: How long one had the arm, s.
        action_age_p50_s: Median age of the accepted actions, s; None without any.
        action_age_p95_s: 95 % quantile, s.
        action_age_max_s: Oldest, s.
        latency_p95_s: 95 % quantile of the drawn latencies, s.
        force_peak_n: Largest contact force, N.
        mode: Mode of the path, as the task names it.
    """

    method: str
    seed: int
    perturbation: str
    start: int
    start_sha256: str
    outcome: str
    success: bool
    duration_s: float
    ticks: int
    action_ticks: int
    hold_ticks: int
    fallback_ticks: int
    invocations: int
    deadline_misses: int
    discards: int
    rejections: int
    rejected_by: str
    recovery_attempted: bool
    recovered: bool
    interventions: int
    person_s: float
    action_age_p50_s: float | None
    action_age_p95_s: float | None
    action_age_max_s: float | None
    latency_p95_s: float | None
    force_peak_n: float
    mode: str


@dataclass(frozen=True)
class InvocationRow:
    """`invocations.parquet` of stress: one invocation of the policy.

    Attributes:
        method: The method.
        seed: Number of its training seed.
        perturbation: What was injected.
        start: Number of the initial state.
        invocation: Count in this rollout; 0 is cold.
        latency_s: From sensor event to delivery: the sum of all terms, and of the checks of
            candidates after the first, s.
    """

    method: str
    seed: int
    perturbation: str
    start: int
    invocation: int
    latency_s: float


@dataclass(frozen=True)
class SpliceRow:
    """`splices.parquet` of stress: one chunk that entered the queue, and how it begins.

    Attributes:
        method: The method.
        seed: Number of its training seed.
        perturbation: What was injected.
        start: Number of the initial state.
        rule: How its chunks join.
        invocation: Count in this rollout.
        parents: Earlier predictions that had a say; 0 where nothing was to be joined.
        raw_jump_m: Way from the last command to the first row that was due, as proposed, m.
        raw_jerk_m_s3: Largest jerk of the TCP over the boundary, as proposed, m/s^3; None where
            too little was commanded before.
        jump_m: The same way, as admitted, m.
        jerk_m_s3: The same jerk, as admitted, m/s^3.
    """

    method: str
    seed: int
    perturbation: str
    start: int
    rule: str
    invocation: int
    parents: int
    raw_jump_m: float
    raw_jerk_m_s3: float | None
    jump_m: float
    jerk_m_s3: float | None


@dataclass(frozen=True)
class RefusedRow:
    """`refused.parquet` of stress: a candidate that a layer refused, of a rollout kept whole.

    Attributes:
        method: The method.
        seed: Number of its training seed.
        perturbation: What was injected.
        start: Number of the initial state.
        chunk_id: Its name in the journal.
        candidate: Its number among the candidates of its invocation.
        layer: The layer that refused it.
        first_reason: The check that it failed at.
        first_row: First row of the chunk that offends against it, counted from 0; None where the
            array is no chunk.
        layer_margin: Margin of that layer; None where it is no number.
        margin_unit: Its unit.
        touching: Names of the two shapes that touch; empty where none do.
        raw: Actions as proposed, row by row.
        projected: Actions as projected, row by row.
    """

    method: str
    seed: int
    perturbation: str
    start: int
    chunk_id: str
    candidate: int
    layer: str
    first_reason: str
    first_row: int | None
    layer_margin: float | None
    margin_unit: str
    touching: tuple[str, ...]
    raw: tuple[float, ...]
    projected: tuple[float, ...]


@dataclass(frozen=True)
class RecoveryRow:
    """`recoveries.parquet` of stress: one entry into recovery.

    Attributes:
        method: The method.
        seed: Number of its training seed.
        perturbation: What was injected.
        start: Number of the initial state.
        recovery: Count in this rollout, from 0.
        phase: Task phase in which it began.
        cause: Why it began, as the rollout names it.
        primitives: Those that began, in order, a space between; empty where none did.
        failures: Of these, failed.
        ended: `handed_back` (the last primitive reached its goal), `timed_out` or `refused` (once
            too often), `person` (one was called), `stopped`, or `episode_over`.
        resampled_only: It handed back and its primitives had commanded nothing but the pose that
            was held, so that whatever helped was a new sample.
        taken_over: After it handed back the policy commanded, before anything else began.
        succeeded: The rollout ended in success.
        recovered: It handed back, not by samples alone, the policy took over and succeeded, and
            none of the later recoveries of the rollout began in the same phase.
        duration_s: From its begin to its end, s.
        force_peak_n: Largest contact force meanwhile, N.
        resets: Stops meanwhile that stay until a person resets the cell.
    """

    method: str
    seed: int
    perturbation: str
    start: int
    recovery: int
    phase: str
    cause: str
    primitives: str
    failures: int
    ended: str
    resampled_only: bool
    taken_over: bool
    succeeded: bool
    recovered: bool
    duration_s: float
    force_peak_n: float
    resets: int


@dataclass(frozen=True)
class StressCountRow:
    """`counts.parquet` of stress: actions discarded, by reason.

    Attributes:
        method: The method.
        perturbation: What was injected.
        reason: Why; empty where none was discarded.
        count: How many.
    """

    method: str
    perturbation: str
    reason: str
    count: int


@dataclass(frozen=True)
class ConservationRow:
    """`conservation.parquet` of stress: balance of actions.

    Attributes:
        method: The method.
        perturbation: What was injected.
        generated: Actions generated.
        executed: Actions executed.
        queued: Actions left in a queue.
        discarded: Actions discarded.
    """

    method: str
    perturbation: str
    generated: int
    executed: int
    queued: int
    discarded: int


@dataclass(frozen=True)
class StressStubRow:
    """`stub.parquet` of stress: what reached the controller stub.

    Attributes:
        method: The method.
        perturbation: What was injected.
        arrivals: Actions that reached the stub.
        stale: Of these, older than allowed.
        invalid: Of these, not of a chunk that passed.
    """

    method: str
    perturbation: str
    arrivals: int
    stale: int
    invalid: int


@dataclass(frozen=True)
class OverrunRow:
    """`overruns.parquet` of stress: terms that took longer than they may, and what was done.

    Attributes:
        method: The method.
        perturbation: What was injected.
        term: Term of the latency; empty where none took too long.
        action: What its owner declared for it, and what the clock did; empty likewise.
        count: How often.
    """

    method: str
    perturbation: str
    term: str
    action: str
    count: int


@dataclass(frozen=True)
class FaultRow:
    """`faults.parquet` of stress: deadlines missed since a policy's process failed, by kind.

    Attributes:
        method: The method: one that was brought.
        perturbation: What was injected.
        fault: Kind, as `genpolicy.candidates.wire.faults.Fault`; empty where none was counted.
        count: How often.
    """

    method: str
    perturbation: str
    fault: str
    count: int


NEUTRAL = {"magnitude_s": 0.0, "probability": 0.0, "factor": 1.0, "force_n": 0.0}
"""Fields that a curve may be drawn over, and their size where nothing is injected: nominal."""


@dataclass(frozen=True)
class SeverityRow:
    """`severities.parquet` of stress: a size of a condition that a curve is drawn over.

    Attributes:
        perturbation: Name under which it was run; that of the condition where it is judged.
        of: The condition.
        field: Which of its fields.
        severity: How large that is.
    """

    perturbation: str
    of: str
    field: str
    severity: float


@dataclass(frozen=True)
class AgeRow:
    """`ages.parquet` of stress: quantiles of the action age over all rollouts of a shard.

    Attributes:
        method: The method.
        perturbation: What was injected.
        level: Quantile level, 0 to 1.
        action_age_s: The order statistic, s.
        actions: Accepted actions.
    """

    method: str
    perturbation: str
    level: float
    action_age_s: float
    actions: int
