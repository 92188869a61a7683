"""Rows of the evidence tables that gates read, one frozen dataclass a table.

Field order is column order. Stages write these rows and gates read them, so a column is spelled
here and nowhere else. The tables of the audit stand with the audit, fixtures with the policies.
Text and identities are `str`, counts whole numbers; None is "not reached" or "not measured",
never zero.
"""

from dataclasses import dataclass

from genpolicy.integrity.rows import (
    check_columns,
    columns_of,
    read_rows,
    schema_of,
    table_of_rows,
    write_rows,
)

__all__ = [
    "AgeRow",
    "CandidateRow",
    "ConservationRow",
    "CoverageRow",
    "EffectRow",
    "FactorErrorRow",
    "FactorModeRow",
    "LatencyRow",
    "ModeRow",
    "NfeRow",
    "OfflineRow",
    "RolloutRow",
    "SampleRow",
    "ShadowCountRow",
    "ShadowStubRow",
    "StressCountRow",
    "StressStubRow",
    "check_columns",
    "columns_of",
    "read_rows",
    "schema_of",
    "table_of_rows",
    "write_rows",
]


@dataclass(frozen=True)
class OfflineRow:
    """`offline.parquet` of measure_baselines and reload: distance to the demonstrated chunk.

    Attributes:
        method: The method.
        seed: Number of its training seed.
        split: Held-out split.
        phase: Task phase of the newest observation.
        windows: Windows compared.
        masked_mae: Mean absolute error of the actions that are not padding, normalised units.
        position_rmse_m: Root mean square distance of the TCP positions, m.
    """

    method: str
    seed: int
    split: str
    phase: str
    windows: int
    masked_mae: float
    position_rmse_m: float


@dataclass(frozen=True)
class ModeRow:
    """`modes.parquet` of measure_baselines and reload: modes reached at one held-out situation.

    Attributes:
        method: The method.
        seed: Number of its training seed.
        convention: How its samples were drawn.
        episode_uuid: The held-out episode.
        index: The row of the situation in it.
        samples: Candidates drawn.
        modes_present: Modes of the situation.
        modes_covered: Modes that at least one sample reaches.
        between_modes: Samples in the middle between two modes.
        admissible: Samples of which the whole chunk passes the six layers.
        nfe: Network evaluations of one invocation, counted.
        spread_m: Mean standard deviation of the positions over samples, m.
    """

    method: str
    seed: int
    convention: str
    episode_uuid: str
    index: int
    samples: int
    modes_present: int
    modes_covered: int
    between_modes: int
    admissible: int
    nfe: int
    spread_m: float


@dataclass(frozen=True)
class FactorErrorRow:
    """`errors.parquet` of measure_factors: error of one variant on one held-out episode.

    Attributes:
        variant: The variant.
        factor: The factor that it changes.
        seed: Number of its training seed.
        convention: How its samples were drawn.
        split: Held-out split.
        episode_uuid: The episode.
        windows: Windows compared.
        chunk_error: Mean absolute error of the chunk's actions, normalised units.
        first_error: That of the first action alone.
    """

    variant: str
    factor: str
    seed: int
    convention: str
    split: str
    episode_uuid: str
    windows: int
    chunk_error: float
    first_error: float


@dataclass(frozen=True)
class FactorModeRow:
    """`modes.parquet` of measure_factors: as `ModeRow`, of a variant.

    Attributes:
        variant: The variant.
        factor: The factor that it changes.
        method: Its method; see `ModeRow` for this and what follows.
    """

    variant: str
    factor: str
    method: str
    seed: int
    convention: str
    episode_uuid: str
    index: int
    samples: int
    modes_present: int
    modes_covered: int
    between_modes: int
    admissible: int
    nfe: int
    spread_m: float


@dataclass(frozen=True)
class EffectRow:
    """`effects.parquet` of measure_factors: a variant against the reference, by episode.

    Attributes:
        variant: The variant.
        factor: The factor that it changes.
        convention: How its samples were drawn.
        measure: What is compared.
        value: Of the variant, mean over the shared episodes; NaN where nothing was measured.
        reference: Of the reference, likewise.
        effect: Mean of the paired differences.
        lower: Lower end of its interval.
        upper: Upper end.
        episodes: Shared episodes.
    """

    variant: str
    factor: str
    convention: str
    measure: str
    value: float
    reference: float
    effect: float
    lower: float
    upper: float
    episodes: int


@dataclass(frozen=True)
class SampleRow:
    """`samples.parquet` of reload: one fixture, sampled at training and after reload.

    Attributes:
        method: The candidate.
        seed: Number of its training seed.
        row: Which fixture.
        sha256_trained: Of the samples drawn at training.
        sha256_reloaded: Of those drawn by a fresh process from the files.
        max_abs_difference: Largest difference of an action component, in its own unit.
    """

    method: str
    seed: int
    row: int
    sha256_trained: str
    sha256_reloaded: str
    max_abs_difference: float


@dataclass(frozen=True)
class NfeRow:
    """`nfe.parquet` of reload: network evaluations of one invocation.

    Attributes:
        method: The candidate.
        seed: Number of its training seed.
        recorded: As written at training.
        counted: As counted at the network after reload.
    """

    method: str
    seed: int
    recorded: int
    counted: int


@dataclass(frozen=True)
class CoverageRow:
    """`coverage.parquet` of reload: modes against sampler steps.

    Attributes:
        method: The candidate.
        seed: Number of its training seed.
        steps: Sampler steps.
        nfe: Network evaluations of one invocation, counted.
        situations: Held-out situations.
        modes_covered_share: Share of them of which every mode is reached.
        coverage_lower: Lower end of its interval (Clopper-Pearson).
        spread_m: Mean over situations of the samples' spread, m.
        admissible_share: Share of the samples that pass the six layers.
        between_share: Share of the samples in the middle between two modes.
    """

    method: str
    seed: int
    steps: int
    nfe: int
    situations: int
    modes_covered_share: float
    coverage_lower: float
    spread_m: float
    admissible_share: float
    between_share: float


@dataclass(frozen=True)
class LatencyRow:
    """`latency.parquet`: one term of one invocation.

    Attributes:
        method: The method.
        run: Which fresh process, from 1; a declared term belongs to the first.
        component: Term of the latency (`genpolicy.contract.latency.Term`).
        owner: Who answers for the term.
        temperature: `cold` or `warm`.
        repeat: Which invocation of its temperature.
        seconds: Duration, s.
        source: `measured` on this machine, or `declared`.
    """

    method: str
    run: int
    component: str
    owner: str
    temperature: str
    repeat: int
    seconds: float
    source: str


@dataclass(frozen=True)
class CandidateRow:
    """`candidates.parquet` of shadow: one candidate at one observation, intact or corrupted.

    Attributes:
        method: The method.
        seed: Number of its training seed.
        fixture: `held_out`, or the corruption.
        situation: Episode and row.
        phase: Task phase.
        observation: Number of the observation.
        candidate: Number of the candidate.
        mode: Mode of the path, as the task names it.
        representation: Whether the layer passed; None where it was not reached.
        kinematic: Likewise.
        geometric: Likewise.
        dynamic: Likewise.
        contact: Likewise.
        fresh: Likewise.
        first_reason: Why the first failing layer failed; empty where all passed.
        layer_margin: Margin of that layer, else the smallest one, in the layer's own unit.
        position_change_m: Largest move of a position by projection, m.
        rotation_change_rad: Largest turn by projection, rad.
        boundary_jerk_m_s3: Jerk at the boundary to the previous command, m/s^3.
        raw: Actions as sampled, row by row.
        projected: Actions as projected, row by row.
    """

    method: str
    seed: int
    fixture: str
    situation: str
    phase: str
    observation: int
    candidate: int
    mode: str
    representation: bool | None
    kinematic: bool | None
    geometric: bool | None
    dynamic: bool | None
    contact: bool | None
    fresh: bool | None
    first_reason: str
    layer_margin: float | None
    position_change_m: float | None
    rotation_change_rad: float | None
    boundary_jerk_m_s3: float | None
    raw: tuple[float, ...]
    projected: tuple[float, ...]


@dataclass(frozen=True)
class ShadowStubRow:
    """`stub.parquet` of shadow: what reached the controller stub.

    Attributes:
        method: The method.
        fixture: `held_out`, or the corruption.
        delivered: Chunks handed to the executor.
        arrivals: Actions that reached the stub.
        stale: Of these, older than allowed.
        invalid: Of these, not of a chunk that passed.
    """

    method: str
    fixture: str
    delivered: int
    arrivals: int
    stale: int
    invalid: int


@dataclass(frozen=True)
class ShadowCountRow:
    """`counts.parquet` of shadow: balance of actions, one row a reason of discard.

    Attributes:
        method: The method.
        fixture: `held_out`, or the corruption.
        generated: Actions generated.
        executed: Actions executed.
        queued: Actions left in a queue.
        reason: Why actions were discarded; empty where none was.
        count: How many.
    """

    method: str
    fixture: str
    generated: int
    executed: int
    queued: int
    reason: str
    count: int


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
        recovered: Whether it succeeded after one.
        interventions: Calls for a person.
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
    action_age_p50_s: float | None
    action_age_p95_s: float | None
    action_age_max_s: float | None
    latency_p95_s: float | None
    force_peak_n: float
    mode: str


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
