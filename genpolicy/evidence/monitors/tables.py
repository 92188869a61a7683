"""The stage's work: thresholds first, frozen, then the episodes that judge them; as tables."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from genpolicy.compute import map_shards
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.monitors.alarms import alarm_rows, threshold_rows
from genpolicy.evidence.monitors.scored import Scored, Scoring, score_method
from genpolicy.evidence.monitors.settings import MonitorsSettings
from genpolicy.evidence.rows.monitors import (
    MonitorAlarmRow,
    MonitorScoreRow,
    MonitorThresholdRow,
    MonitorUnavailableRow,
)
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.evidence.shadow.tables import checker_document
from genpolicy.evidence.stress.matched import run_shard
from genpolicy.evidence.stress.shard import Shard
from genpolicy.feasibility.cell import cell_of
from genpolicy.integrity.rows import write_rows
from genpolicy.tasks.api import load_task


@dataclass(frozen=True)
class Work:
    """Where the rollouts and the scoring run.

    Attributes:
        workers: Local processes.
        scheduler: `local` or the address of a Dask scheduler.
    """

    workers: int
    scheduler: str


def write_monitors(
    folder: Path,
    settings: MonitorsSettings,
    *,
    thresholds: Sequence[Shard],
    judged: Callable[[], Sequence[Shard]],
    scoring: Callable[[Sequence[Shard]], list[Scoring]],
    work: Work,
) -> None:
    """Run, score and write: the thresholds lie on disk before a judging start is drawn.

    Args:
        folder: Existing folder; shards write their journals below `journals`.
        settings: Section `monitors`, with probes.
        thresholds: Rollouts that set the thresholds.
        judged: Draws the starts of all other rollouts; called after that.
        scoring: Who scores the journals of which shards.
        work: Where it runs.
    """
    (folder / "journals").mkdir()
    task = load_task(thresholds[0].comparison.task)
    rollouts, scored = _run(thresholds, scoring, work)
    above = threshold_rows(scored.scores, rollouts, alpha=settings.alpha, phases=task.phases)
    write_rows(folder / "thresholds.parquet", MonitorThresholdRow, above)
    shards = judged()
    gone = {(row.method, row.monitor) for row in scored.unavailable}
    more, again = _run(shards, lambda some: [_without(one, gone) for one in scoring(some)], work)
    rollouts, scores = [*rollouts, *more], [*scored.scores, *again.scores]
    absent = [*scored.unavailable, *again.unavailable]
    alarms = alarm_rows(scores, rollouts, above, settings, contact_phases=task.contact_phases)
    write_rows(folder / "rollouts.parquet", RolloutRow, rollouts)
    write_rows(folder / "scores.parquet", MonitorScoreRow, scores)
    write_rows(folder / "alarms.parquet", MonitorAlarmRow, alarms)
    write_rows(folder / "unavailable.parquet", MonitorUnavailableRow, absent)
    comparison = thresholds[0].comparison
    robot = cell_of(
        task,
        comparison.feasibility,
        action_period_s=comparison.cell.horizons.action_period_s,
    )
    journals = [shard.journal for shard in (*thresholds, *shards)]
    checked = checker_document(journals, cell=comparison.cell, robot=robot, task=task)
    CHECKER.write(folder, checked)


def write_unwatched(folder: Path) -> None:
    """The same tables without a row: no probe was asked for, and no monitor was looked at."""
    write_rows(folder / "thresholds.parquet", MonitorThresholdRow, [])
    write_rows(folder / "rollouts.parquet", RolloutRow, [])
    write_rows(folder / "scores.parquet", MonitorScoreRow, [])
    write_rows(folder / "alarms.parquet", MonitorAlarmRow, [])
    write_rows(folder / "unavailable.parquet", MonitorUnavailableRow, [])


def _without(one: Scoring, gone: set[tuple[str, str]]) -> Scoring:
    """Without the monitors that have no thresholds of this method: they would be silent."""
    left = tuple(name for name in one.monitors if (one.judged.name, name) not in gone)
    return replace(one, monitors=left)


def _run(
    shards: Sequence[Shard], scoring: Callable[[Sequence[Shard]], list[Scoring]], work: Work
) -> tuple[list[RolloutRow], Scored]:
    """Rows of the rollouts of some shards, and the scores of their journals."""
    results = map_shards(run_shard, shards, workers=work.workers, scheduler=work.scheduler)
    rollouts = [row for result in results for row in result.rollouts]
    scored = map_shards(
        score_method, scoring(shards), workers=work.workers, scheduler=work.scheduler
    )
    return rollouts, Scored(
        [row for one in scored for row in one.scores],
        [row for one in scored for row in one.unavailable],
    )
