"""Rows of measure_baselines and measure_factors: errors, modes and effects."""

from dataclasses import dataclass


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

    Also `modes_earlier.parquet` of reload: by the weights at three quarters of the training.

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
        far_from_modes: Samples further from every mode than the modes are apart, and not between.
        admissible: Samples of which the whole chunk passes the six layers.
        valid: Those of them that reach a mode.
        modes_valid: Modes that at least one of those reaches.
        fewest_admissible: Admissible samples that reach the mode reached by the fewest of them.
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
    far_from_modes: int
    admissible: int
    valid: int
    modes_valid: int
    fewest_admissible: int
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
    far_from_modes: int
    admissible: int
    valid: int
    modes_valid: int
    fewest_admissible: int
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
