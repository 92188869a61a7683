"""What the stage writes: every rollout that was asked for, and of each failure a file of its own.

A failure's file says all that its rollout hangs on, and the hash of what happened in it: whoever
runs it again (`python -m stages.failure_search FILE`) can say whether the same happened.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from genpolicy.candidates.contenders import Contender, opened
from genpolicy.compute import map_shards
from genpolicy.errors import BadInputError
from genpolicy.evidence.documents.failures import FAILURE, Failure
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.failure_search.conditions import Condition
from genpolicy.evidence.failure_search.rollouts import (
    Asked,
    Searching,
    run_asked,
    run_search,
)
from genpolicy.evidence.rows.failures import FAILURES, SearchedRow, failure_name
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.evidence.shadow.tables import checker_document
from genpolicy.evidence.stress.latency import LatencyModel
from genpolicy.evidence.stress.shard import Comparison, Shard
from genpolicy.execution.journal import Event, Journal
from genpolicy.feasibility.cell import cell_of
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.integrity.rows import write_rows
from genpolicy.tasks.api import load_task

SEARCHED_TABLE, ROLLOUTS = "searched.parquet", "rollouts.parquet"
JOURNALS = "journals"
"""Folder below that of the stage: what happened in all rollouts."""


def plan_searches(
    comparison: Comparison,
    candidates: Sequence[Contender],
    conditions: Sequence[Condition],
    *,
    evaluations: int,
    latency: Mapping[str, LatencyModel],
    journals: Path,
) -> list[Searching]:
    """Every candidate in every condition, conditions outermost.

    Args:
        comparison: What all share, as the stage `stress` has it, without starts.
        candidates: Whose failures are searched.
        conditions: What is searched.
        evaluations: Rollouts of each candidate in each condition.
        latency: Latency of each candidate.
        journals: Folder of the journals.
    """
    return [
        Searching(
            Shard(
                comparison=comparison,
                judged=candidate,
                latency=latency[candidate.name],
                perturbation=condition.name,
                schedule=condition.planned,
                journal=journals / f"{candidate.name}__{condition.name}.mcap",
            ),
            condition,
            evaluations,
        )
        for condition in conditions
        for candidate in candidates
    ]


def write_searches(
    folder: Path, searches: Sequence[Searching], *, workers: int, scheduler: str
) -> None:
    """Run every search and write its rows, its journal, and a file for each failure.

    Args:
        folder: Existing folder; journals are written below it.
        searches: One per candidate and condition; without any, tables without a row are written.
        workers: Local processes.
        scheduler: `local` or the address of a Dask scheduler.
    """
    for name in (JOURNALS, FAILURES):
        (folder / name).mkdir()
    results = map_shards(run_search, searches, workers=workers, scheduler=scheduler)
    rows = [row for result in results for row in result.rows]
    write_rows(folder / SEARCHED_TABLE, SearchedRow, rows)
    rollouts = [row for result in results for row in result.rollouts]
    write_rows(folder / ROLLOUTS, RolloutRow, rollouts)
    for searching, result in zip(searches, results, strict=True):
        for row, journal in zip(result.rows, result.journals, strict=True):
            if row.failed:
                said = FAILURE.plain(failure_of(searching, row, journal))
                write_bytes(folder / FAILURES / failure_name(row), canonical_json(said))
    if not searches:
        return
    comparison = searches[0].shard.comparison
    task = load_task(comparison.task)
    period_s = comparison.cell.horizons.action_period_s
    robot = cell_of(task, comparison.feasibility, action_period_s=period_s)
    journals = [searching.shard.journal for searching in searches]
    checked = checker_document(journals, cell=comparison.cell, robot=robot, task=task)
    CHECKER.write(folder, checked)


def failure_of(searching: Searching, row: SearchedRow, journal: Journal) -> Failure:
    """What the file of a failure says."""
    comparison, judged = searching.shard.comparison, searching.shard.judged
    return Failure(
        task=comparison.task,
        method=row.method,
        checkpoint=judged.sha256,
        training_seed=row.seed,
        root_seed=comparison.root_seed,
        condition=row.of,
        perturbation=row.perturbation,
        severity=row.severity,
        number=row.start,
        point=list(row.point),
        start=row.scene_start,
        start_sha256=row.start_sha256,
        outcome=row.outcome,
        events_sha256=events_sha256(journal.events()),
    )


def search_of(searches: Iterable[Searching], failure: Failure) -> Searching:
    """The search that a failure was found by, among those that are planned here.

    Raises:
        BadInputError: It is of none of them.
    """
    said = (failure.method, failure.checkpoint, failure.perturbation, failure.root_seed)
    for searching in searches:
        judged, seed = searching.shard.judged, searching.shard.comparison.root_seed
        if (judged.name, judged.sha256, searching.condition.name, seed) == said:
            return searching
    raise BadInputError(
        where=f"failure {failure.method}/{failure.perturbation}/{failure.number}",
        found=f"of identity {failure.checkpoint[:12]} and root seed {failure.root_seed}",
        expected="a candidate, a condition and a seed of this workspace",
        action="Go to the workspace that it was found in.",
    )


def run_again(searching: Searching, failure: Failure) -> Failure:
    """Run the rollout of a failure again, alone; what its file would say now."""
    shard = searching.shard
    asked = Asked(failure.number, tuple(failure.point), failure.start, failure.severity)
    task = load_task(shard.comparison.task)
    with opened(shard.judged, task.observation, scene=task.scene_path) as policy:
        ended = run_asked(searching, task, policy, [asked])
    return failure_of(searching, ended.rows[0], ended.journals[0])


def events_sha256(events: Iterable[Event]) -> str:
    """Hash of all events of a session, in order."""
    told = [[event.n, event.kind, event.t, event.payload] for event in events]
    return sha256_bytes(canonical_json(told))
