"""`summary.json` and `persistence.json` of the audit: what gates and pages read of it."""

from dataclasses import dataclass

from genpolicy.documents.document import Count, Document


@dataclass(frozen=True)
class Counts:
    """What was found, in numbers; episodes are distinct held-out episodes.

    Attributes:
        queries: Situations looked at.
        analysed: Situations with enough neighbours.
        analysed_episodes: Held-out episodes with at least one of them.
        two_mode: Situations with several modes under one observation.
        two_mode_episodes: Held-out episodes with at least one of them.
        primary_episodes: Analysed held-out episodes of the phase with most situations of several
            modes; of none where there is no such phase.
        resolved: Situations with clusters that are not claimed as modes: an observed component
            tells them apart, or they are too few in their phase.
        incoherent: Situations with clusters in phases where they do not persist.
        persistent: Situations with several modes that persist.
        noise_ratio: Median von Neumann ratio of the spread inside situations: 1 white, 0 smooth.
        noise_spread: Median spread inside situations, unit of the position.
        white_share: Median share of that white noise in all of the spread, constant differences
            between the chunks counted as well.
    """

    queries: int
    analysed: int
    analysed_episodes: int
    two_mode: int
    two_mode_episodes: int
    primary_episodes: int
    resolved: int
    incoherent: int
    persistent: int
    noise_ratio: float
    noise_spread: float
    white_share: float

    @property
    def share(self) -> float:
        """Share of the situations with enough neighbours."""
        return self.analysed / self.queries if self.queries else 0.0


@dataclass(frozen=True)
class Persistence:
    """Identity kept over time.

    Attributes:
        observed: Mean share of episodes that keep their cluster, over the situations.
        null_q95: 95 % quantile of the same under the null.
        null_mean: Its mean.
        n: Situations in which it could be measured.
    """

    observed: float
    null_q95: float
    null_mean: float
    n: int


@dataclass(frozen=True)
class Obstacle:
    """A round obstacle of the scene plane, base frame, m."""

    x_m: float
    y_m: float
    radius_m: float


@dataclass(frozen=True)
class Summary:
    """Counts, floors and names.

    Attributes:
        episodes: Episodes of the dataset.
        rows: Rows of the dataset.
        floors: From where on the audit reports, by question.
        ceilings: From where on it takes modes back, by question.
        metre: How much of the position's unit stands for a metre.
        primary_phase: The phase with most situations of several modes; empty where none is.
        counts: What was found.
        modes_before_realignment: Held-out episodes with several modes as recorded.
        modes_after_realignment: The same on realigned data.
        modes_with_phase: Held-out episodes with several modes where the phase is looked at.
        modes_without_phase: The same where it is not.
        position_names: Names of the position's components.
        position_unit: Their unit; empty where they do not agree.
        mean_checked: Situations of several modes whose mean was checked.
        mean_defeated: Of these, those in which the mean is refused and every mode passes.
        gaps: Rows that follow a gap in time.
        start_drift: Largest difference of the median start position between training and held-out
            episodes, unit of the position.
        notes: Sentences on what is worth knowing and no deviation.
        obstacles: Round obstacles, for plots.
    """

    episodes: Count
    rows: Count
    floors: dict[str, float]
    ceilings: dict[str, float]
    metre: float
    primary_phase: str
    counts: Counts
    modes_before_realignment: Count
    modes_after_realignment: Count
    modes_with_phase: Count
    modes_without_phase: Count
    position_names: list[str]
    position_unit: str
    mean_checked: Count
    mean_defeated: Count
    gaps: Count
    start_drift: float
    notes: list[str]
    obstacles: list[Obstacle]


SUMMARY = Document("summary.json", Summary)
PERSISTENCE = Document("persistence.json", Persistence)
