"""Settings of the audit: what counts as near and as two modes, and from where on it reports.

Nothing here decides a cause: limits stand in `params.yaml: gate_a`, with owner and reason. A
`floor` is the smallest deviation that is looked for; a limit below it cannot be held against the
evidence.
"""

import math
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class AuditSettings(BaseModel):
    """Frozen and strict. Lengths in m (or the unit of the action's position), times in s.

    Attributes:
        observation_horizon: Observations that condition an invocation.
        chunk_rows: Actions per chunk, K.
        confidence: Of each end of the interval of what a variable tells.
        position_channel: Observed TCP position (or joint angles); its components pair with the
            first of the action. None: nothing in the observation pairs with the action.
        position_components: Names `channel.component` that pair with the action, where they are
            not one whole channel; overrides `position_channel`.
        action_components: Names of the action's components that pair with them, in their order;
            None takes the first ones.
        action_forms: What a component of the action is, where it is no place: a `change` per row or
            a `rate` is added up; `unknown` is read as it stands.
        action_gains: How far one of it moves what it commands (per row where it is added up).
        action_offsets: What a place of 0 commands.
        phase_observed: Whether the policy sees the phase. If not, situations are looked for
            across phases and the phase is tested as a hidden variable.
        reference_channel: Observed pose of what is released into; None where there is none.
        calibration_phase: Phase whose first row gives the calibration residual.
        context_channels: Observed channels that are held against the modes.
        ignored_channels: Channels without a part in the distance between observations.
        scale_m: Difference of a length that makes another observation, m.
        scale_n: The same for a force, N.
        scale_px: The same for a length in pixels.
        scale_rad: The same for an angle, rad.
        scale_unit: The same for a pure number (direction cosines and the like).
        channel_scale: The same by channel, in its unit; overrides the rules above.
        radius: Furthest neighbour, in units of the scales (Euclidean over the history).
        neighbours: Training episodes per neighbourhood, at most.
        minimum_neighbours: Fewer inside the radius: the situation is not analysed.
        query_stride: Every how many rows of a held-out episode a query is made.
        maximum_queries_per_phase: Cap; above it queries are drawn at random.
        representation: `path` compares routes at equal arc length, `time` at equal times.
        minimum_separation_m: Modes nearer than this (RMS over the chunk) are one.
        minimum_gain: Likelihood gain of two components over one that makes two modes; at 10 about
            1.5 % of uniform clouds of 20 chunks pass along one axis, and 0.1 % of Gaussian ones.
        minimum_mode_share: Smallest share of a neighbourhood that makes a mode.
        minimum_mode_size: Smallest number of episodes that makes a mode.
        resolved_auc: One observed component that tells the clusters apart this well (and by more
            than its scale) means that the observation is not the same.
        persistence_lag_rows: How much later the clusters must still be there.
        maximum_lag_rows: Search range of the action-to-state lag.
        declared_lag_rows: Lag that the contract states; None takes the median of the episodes.
        clock_floor_s: Offsets of a clock are reported from here on.
        clock_resolution_rows: No lag is believed finer than this, action steps.
        significance: An offset is reported only beyond this many of its standard errors: with some
            twenty of them per data set one in 10,000 clean ones is called defective by chance.
        outlier_share: Share of single episodes with one fault (and two of them at least) that
            makes it worth reporting; below it is a mishap without weight.
        drift_floor_rows: Reported from: growth of the lag from the first to the last row of an
            episode, action steps. Plants differ by up to a step between slow and fast motion.
        gain_floor: Reported from: factor between commanded and observed motion. No arm follows
            that badly, and units differ by more.
        gain_epoch_floor: Reported from: the same between one epoch and all.
        frame_floor_rad: Reported from: angle between commanded and observed motion. An arm that
            follows its axes unequally stays below it.
        magnitude_floor: Reported from: factor between an episode and the usual one that may be a
            unit. No object stands five times further away.
        rate_floor: Reported from: deviation of the period of the rows from the declared one, as its
            share.
        frozen_floor_s: Reported from: how long a stream shows the same while the arm moves. No
            older observation is acted upon.
        gap_share_floor: Reported from: share of rows that follow a gap. At 1 % every sixth chunk
            of 16 holds one.
        jitter_floor_share: Reported from: deviation of every tenth row from the period, as its
            share.
        negative_delay_tolerance_s: A sample may be received this much before it happened (what the
            correction of a clock leaves); beyond it is counted.
        calibration_floor_m: Reported from: calibration residual of an epoch.
        metre: How much of the position's unit stands for a metre, so that limits in m hold for
            pixels and joint angles as well.
        replay_episodes: Episodes to replay, drawn at random, at most.
        minimum_two_mode_situations: Held-out episodes of a phase with several modes, below which
            the phase is said to have one: the floor of the limit on their number.
        minimum_two_mode_share: The same as a share of its analysed held-out episodes. Where the
            task has modes, most episodes come by; chance gives a cloud without modes that is
            looked at in ten situations an episode up to a tenth of them.
        minimum_persistent_share: Share of a phase's situations with clusters that must keep them,
            each beyond its own shuffled-time null, for the clusters to be modes: most of them.
        white_ratio: Median von Neumann ratio along the chunk (0 smooth, 1 white noise) from which
            on a phase's clusters are no modes: half way. The ceiling of the limit on noise, since a
            higher one would find the modes taken back already.
        strata_resolution: Smallest adjusted p-value that the permutations must be able to reach,
            doubled.
        permutations: Permutations per test.
        resamples: Draws of the resampling that shows how stable the cause is.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    observation_horizon: int = Field(default=2, ge=1)
    chunk_rows: int = Field(default=16, ge=2)
    confidence: float = Field(default=0.95, gt=0.5, lt=1)
    position_channel: str | None = "tcp_position_m"
    position_components: list[str] | None = None
    action_components: list[str] | None = None
    action_forms: dict[str, Literal["place", "change", "rate", "unknown"]] = Field(
        default_factory=dict
    )
    action_gains: dict[str, float] = Field(default_factory=dict)
    action_offsets: dict[str, float] = Field(default_factory=dict)
    phase_observed: bool = True
    reference_channel: str | None = None
    calibration_phase: str = ""
    context_channels: list[str] = []
    ignored_channels: list[str] = ["phase"]
    scale_m: float = Field(default=0.01, gt=0)
    scale_n: float = Field(default=5.0, gt=0)
    scale_px: float = Field(default=10.0, gt=0)
    scale_rad: float = Field(default=0.05, gt=0)
    scale_unit: float = Field(default=0.1, gt=0)
    channel_scale: dict[str, float] = Field(default_factory=dict)
    radius: float = Field(default=6.0, gt=0)
    neighbours: int = Field(default=20, ge=4)
    minimum_neighbours: int = Field(default=12, ge=4)
    query_stride: int = Field(default=2, ge=1)
    maximum_queries_per_phase: int = Field(default=4000, ge=1)
    representation: Literal["path", "time"] = "path"
    minimum_separation_m: float = Field(default=0.03, gt=0)
    minimum_gain: float = Field(default=10.0, ge=0)
    minimum_mode_share: float = Field(default=0.15, gt=0, lt=0.5)
    minimum_mode_size: int = Field(default=3, ge=2)
    resolved_auc: float = Field(default=0.95, gt=0.5, le=1.0)
    persistence_lag_rows: int = Field(default=16, ge=1)
    maximum_lag_rows: int = Field(default=12, ge=1)
    declared_lag_rows: float | None = None
    clock_floor_s: float = Field(default=0.01, gt=0)
    clock_resolution_rows: float = Field(default=0.25, gt=0)
    significance: float = Field(default=4.5, gt=0)
    outlier_share: float = Field(default=0.02, gt=0, lt=1)
    drift_floor_rows: float = Field(default=1.5, gt=0)
    gain_floor: float = Field(default=3.0, gt=1)
    gain_epoch_floor: float = Field(default=1.15, gt=1)
    frame_floor_rad: float = Field(default=0.14, gt=0)
    magnitude_floor: float = Field(default=5.0, gt=1)
    rate_floor: float = Field(default=0.1, gt=0, lt=1)
    frozen_floor_s: float = Field(default=0.3, gt=0)
    gap_share_floor: float = Field(default=0.01, gt=0, lt=1)
    jitter_floor_share: float = Field(default=0.5, gt=0)
    negative_delay_tolerance_s: float = Field(default=0.001, ge=0)
    calibration_floor_m: float = Field(default=0.003, gt=0)
    metre: float = Field(default=1.0, gt=0)
    replay_episodes: int = Field(default=60, ge=0)
    minimum_two_mode_situations: int = Field(default=5, ge=1)
    minimum_two_mode_share: float = Field(default=0.2, gt=0, lt=1)
    minimum_persistent_share: float = Field(default=0.5, gt=0, le=1)
    white_ratio: float = Field(default=0.5, gt=0, le=1)
    strata_resolution: float = Field(default=0.05, gt=0, lt=1)
    permutations: int = Field(default=999, ge=99)
    resamples: int = Field(default=200, ge=20)

    @property
    def floors(self) -> dict[str, float]:
        """Where reporting begins, by the question whose limit may not lie below it."""
        return {
            "clock_residual_s": self.clock_floor_s,
            "lag_drift_rows": self.drift_floor_rows,
            "gain_factor": self.gain_floor,
            "gain_epoch_factor": self.gain_epoch_floor,
            "frame_angle_rad": self.frame_floor_rad,
            "magnitude_factor": self.magnitude_floor,
            "rate_deviation": self.rate_floor,
            "frozen_s": self.frozen_floor_s,
            "gap_share": self.gap_share_floor,
            "jitter_share": self.jitter_floor_share,
            "calibration_residual_m": self.calibration_floor_m / self.metre,
            "faulty_episodes_share": self.outlier_share,
            "two_mode_episodes": self.minimum_two_mode_situations,
            "two_mode_share": self.minimum_two_mode_share,
        }

    @property
    def ceilings(self) -> dict[str, float]:
        """Where modes are taken back, by the question whose limit may not lie above it."""
        return {"noise_ratio": self.white_ratio}

    def least_two_mode_episodes(self, analysed: int) -> int:
        """Held-out episodes with several modes that it takes among so many analysed ones."""
        share = math.ceil(self.minimum_two_mode_share * analysed)
        return max(self.minimum_two_mode_situations, share)
