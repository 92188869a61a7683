"""Rows about the reach of each kind of evidence, alternative modes, and a stable structure."""

from dataclasses import dataclass

from genpolicy.audit.rows import Finding

LOCAL, LEARNED = "local", "learned"
"""Kinds of evidence: neighbours in every observation, or in what predicts the action."""


@dataclass(frozen=True)
class Reach:
    """`reach.parquet`: one fifth of the way, looked at by one kind of evidence.

    Attributes:
        kind: `local` or `learned`.
        fifth: 1 at the start, 5 at the end.
        queries: Held-out situations there.
        spoke: Of them those of which the evidence could speak.
    """

    kind: str
    fifth: int
    queries: int
    spoke: int

    @property
    def share(self) -> float:
        """Share that could be looked at; all of nothing."""
        return self.spoke / self.queries if self.queries else 1.0


@dataclass(frozen=True)
class Side:
    """`sides.parquet`: what one kind of evidence found.

    Attributes:
        kind: `local` or `learned`.
        followed: Whether modes, links, variables and outcomes are about its situations.
        queries: As in `genpolicy.audit.counts`, and so are those up to `white_share`.
        analysed: The same: those of which it could speak.
        analysed_episodes: The same.
        two_mode: The same.
        two_mode_episodes: The same.
        primary_episodes: The same.
        resolved: The same.
        incoherent: The same.
        persistent: The same.
        noise_ratio: The same.
        noise_spread: The same.
        white_share: The same.
        kept: Share of episodes that keep their mode.
        kept_null_q95: What chance reaches in 95 of 100.
        kept_n: Situations in which it could be measured.
        confirmed: Situations with modes of the other kind that have them here as well.
        contradicted: Those that have none here, though modes as far apart would have been found.
    """

    kind: str
    followed: bool
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
    kept: float
    kept_null_q95: float
    kept_n: int
    confirmed: int
    contradicted: int


@dataclass(frozen=True)
class Alternative:
    """`alternatives.parquet`: two modes between which there was a choice under one observation.

    Modes of starts that have no situation in common were followed apart: they are no choice.

    Attributes:
        phase: Task phase.
        mode: Name, as in `modes.parquet`.
        other: Name of the other one.
        situations: Situations that hold both.
    """

    phase: str
    mode: str
    other: str
    situations: int


@dataclass(frozen=True)
class StructureDraw:
    """`structure_draws.parquet`: support and structure of one draw, beside `resamples.parquet`.

    Attributes:
        queries: Situations looked at.
        analysed: Situations with enough neighbours.
        analysed_episodes: Held-out episodes with at least one of them.
        primary_episodes: Of them those of the phase with most situations of several modes.
        resolved: Situations with clusters that are not claimed as modes.
        noise_ratio: Median von Neumann ratio of the spread.
        noise_spread: Median spread.
        white_share: Median share of white noise in all of the spread.
        reach_queries: Queries of each fifth.
        reach_spoke: Of them with enough neighbours.
        findings: Which set of re-measured findings belongs to the draw; -1 for those measured.
        successes: Successes of each mode of the phase with most situations.
    """

    queries: int
    analysed: int
    analysed_episodes: int
    primary_episodes: int
    resolved: int
    noise_ratio: float
    noise_spread: float
    white_share: float
    reach_queries: tuple[int, ...]
    reach_spoke: tuple[int, ...]
    findings: int
    successes: tuple[int, ...]


@dataclass(frozen=True)
class FindingDraw:
    """`finding_draws.parquet`: one finding of the data semantics of half of the episodes.

    Half of the episodes, drawn without replacement, scatter as much as a bootstrap of all does.

    Attributes:
        draw: Which half-sample, counted from 0.
        kind: As of `findings.parquet`, and so are the others.
        variable: The same.
        where: The same.
        question: The same.
        measured: The same.
        floor: The same.
        unit: The same.
        action: The same.
    """

    draw: int
    kind: str
    variable: str
    where: str
    question: str
    measured: float
    floor: float
    unit: str
    action: str

    @property
    def finding(self) -> Finding:
        """The finding itself."""
        names = Finding.__dataclass_fields__
        return Finding(**{name: getattr(self, name) for name in names})


FURTHER_TABLES: dict[str, type] = {
    "alternatives": Alternative,
    "finding_draws": FindingDraw,
    "reach": Reach,
    "sides": Side,
    "structure_draws": StructureDraw,
}
"""Row of each table that stands beside those of `genpolicy.audit.rows.TABLES`."""
