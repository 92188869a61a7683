"""Rows of the audit's tables, one frozen dataclass a table.

Field order is column order, as in `genpolicy.evidence.rows`. The audit measures these rows, gates
and pages read them, so a column is spelled here and nowhere else; this file imports rows only.
Most are what the audit itself computes with. None is "not measured", never zero.
"""

from dataclasses import dataclass

from genpolicy.audit.component_rows import ComponentModes, Tremor
from genpolicy.audit.followed_rows import Demonstration
from genpolicy.audit.hidden_rows import Asked, Prediction, Stratum
from genpolicy.audit.shown_rows import Alignment, ExampleChunk, SupportPoint

__all__ = ["Asked", "Demonstration", "Prediction", "Stratum"]  # and what is defined here


@dataclass(frozen=True)
class Clock:
    """`clocks.parquet`: one stream in one calibration epoch.

    Attributes:
        stream: Name of the stream.
        epoch: Calibration epoch.
        episodes: Episodes measured.
        offset_before_s: Deviation from the declared alignment.
        offset_after_s: What is left after realignment, measured on the other half of the episodes.
        lag_rows: Action-to-state lag for the stream of the position; for the others the median
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
    lag_rows: float | None
    receive_delay_p50_s: float | None
    receive_delay_p95_s: float | None
    jitter_p95_s: float | None


@dataclass(frozen=True)
class Calibration:
    """`calibration.parquet`: one calibration epoch.

    Attributes:
        epoch: The epoch.
        episodes: Its episodes with a release.
        residual_m: How far its releases lie from those of the others; None without a release.
    """

    epoch: str
    episodes: int
    residual_m: float | None


@dataclass(frozen=True)
class Finding:
    """`findings.parquet`: one deviation that stands out of the noise.

    Whether it is a fault, a limit says elsewhere.

    Attributes:
        kind: One of `genpolicy.audit.semantics.report.KINDS`.
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
class SituationRow:
    """`neighbourhoods.parquet`: one analysed situation.

    Attributes:
        split: Split of the episode that asks.
        phase: Task phase.
        episode_uuid: The episode.
        index: Its row.
        neighbours: Training episodes that stood in nearly the same place.
        clusters: Clusters of their chunks and the query's own.
        cluster_sizes: Chunks in each.
        two_mode: Whether the clusters count as modes.
        separation_m: Smallest RMS distance of two clusters, unit of the component.
        mean_admissible: Whether the mean chunk passes the feasibility check.
        mean_reason: Why not.
        median_admissible: Whether the point-wise median of the chunks passes it.
        modes_admissible: Modal chunks that pass it.
        mean_path: Positions of the mean chunk. K times P numbers.
        mode_paths: Positions of each modal chunk.
        persistent: Whether the clusters keep their episodes: of the position a chunk later, of
            another component in the actions between those that were clustered.
        component: Component of the action that was clustered.
    """

    split: str
    phase: str
    episode_uuid: str
    index: int
    neighbours: int
    clusters: int
    cluster_sizes: tuple[int, ...]
    two_mode: bool
    separation_m: float
    mean_admissible: bool | None
    mean_reason: str
    median_admissible: bool | None
    modes_admissible: int
    mean_path: tuple[float, ...]
    mode_paths: tuple[tuple[float, ...], ...]
    persistent: bool
    component: str


@dataclass(frozen=True)
class ModeOutcome:
    """`modes.parquet`: success and feasibility of one mode of one phase.

    Attributes:
        mode: Name.
        phase: Task phase.
        episodes: Episodes of the mode, recoveries left out.
        successes: Of them successful; by replay where replayed, else by label.
        success_lower: Lower end of the exact interval.
        success_upper: Upper end of the exact interval.
        admissible: Modal chunks that passed the feasibility check.
        checked: Modal chunks checked.
    """

    mode: str
    phase: str
    episodes: int
    successes: int
    success_lower: float
    success_upper: float
    admissible: int
    checked: int


@dataclass(frozen=True)
class ReplayRow:
    """`replay.parquet`: one replayed episode.

    Attributes:
        episode_uuid: The episode.
        label: Its recorded outcome.
        replayed: What the replay did.
        mode: Mode that it followed in the phase with most situations; None for none.
    """

    episode_uuid: str
    label: str
    replayed: str
    mode: str | None


@dataclass(frozen=True)
class RecoveryOutcome:
    """`recovery.parquet`: disturbed episodes of one split that followed one mode.

    Attributes:
        split: The split.
        mode: The mode; `unassigned` for episodes near no situation.
        episodes: Disturbed episodes.
        successes: Of them successful.
    """

    split: str
    mode: str
    episodes: int
    successes: int


@dataclass(frozen=True)
class Resample:
    """`resamples.parquet`: the numbers of one draw.

    Attributes:
        disagreements: Labels that a replay contradicts.
        disagreement_upper: Exact upper bound of their share.
        two_mode: Situations with several modes.
        two_mode_episodes: Held-out episodes with at least one of them.
        incoherent: Situations with clusters that do not persist.
        persistent: Situations with several modes that persist.
        kept: Share of episodes that keep their mode.
        kept_null_q95: What chance reaches in 95 of 100.
        kept_n: Situations in which it could be measured.
        p_adjusted: One for each row of `strata.parquet`; None where it was not tested.
        effect: The same.
        effect_lower: The same.
        told: One for each row of `predictions.parquet`.
        success_lower: One for each mode of the phase with most situations.
        admissible: The same.
    """

    disagreements: int
    disagreement_upper: float
    two_mode: int
    two_mode_episodes: int
    incoherent: int
    persistent: int
    kept: float
    kept_null_q95: float
    kept_n: int
    p_adjusted: tuple[float | None, ...]
    effect: tuple[float | None, ...]
    effect_lower: tuple[float | None, ...]
    told: tuple[float, ...]
    success_lower: tuple[float, ...]
    admissible: tuple[int, ...]


TABLES: dict[str, type] = {
    "alignment": Alignment,
    "asked": Asked,
    "calibration": Calibration,
    "clocks": Clock,
    "components": ComponentModes,
    "demonstrated": Demonstration,
    "examples": ExampleChunk,
    "findings": Finding,
    "modes": ModeOutcome,
    "neighbourhoods": SituationRow,
    "predictions": Prediction,
    "recovery": RecoveryOutcome,
    "replay": ReplayRow,
    "resamples": Resample,
    "strata": Stratum,
    "support": SupportPoint,
    "tremor": Tremor,
}
"""Row of each table, by name without the suffix."""
