"""Rows about how far each kind of evidence reaches, and how stable the structure is."""

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
    "finding_draws": FindingDraw,
    "reach": Reach,
    "structure_draws": StructureDraw,
}
"""Row of each table that stands beside those of `genpolicy.audit.rows.TABLES`."""
