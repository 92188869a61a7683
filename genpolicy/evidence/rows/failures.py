"""Rows of the failure search, and the files by which what it found is run again."""

from dataclasses import dataclass

FAILURES = "failures"
"""Folder below that of the stage, with a file of each failure."""


@dataclass(frozen=True)
class SearchedRow:
    """`searched.parquet` of failure_search: one rollout that the search asked for.

    Attributes:
        method: The candidate.
        seed: Number of its training seed.
        perturbation: Name under which the condition was run: its own, and `@search`.
        of: The condition as planned.
        start: Count in this search, from 0; key of the draws.
        point: What the search asked for: what the start is drawn from, then the size, in [0, 1].
        scene_start: The start, as JSON.
        start_sha256: Hash of the state after reset.
        field: Which field of the condition was varied; empty where it has no size.
        severity: How large that was; None without one.
        most: Largest size that is stated of it; None without one.
        outcome: How the rollout ended.
        failed: Whether it was no success.
        worth: What the search was told, and makes small: of a success the share of time or force
            that was left, whichever is less; of a failure the share of the largest size, less one,
            so that milder failures are worth less.
    """

    method: str
    seed: int
    perturbation: str
    of: str
    start: int
    point: tuple[float, ...]
    scene_start: str
    start_sha256: str
    field: str
    severity: float | None
    most: float | None
    outcome: str
    failed: bool
    worth: float


def failure_name(row: SearchedRow) -> str:
    """Name of the file of a failure."""
    return f"{row.method}__{row.perturbation}__{row.start}.json"
