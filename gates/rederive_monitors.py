"""Thresholds and alarms of monitors, computed again from recorded scores; ends from journals.

Scores themselves are taken as recorded: the checkpoint is bound, and what it draws for the stress
rollouts is drawn again elsewhere. What a reader acts on, who would have alarmed when, follows from
them by rank and comparison alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from gates.rederive_checked import rederive_checked
from gates.rederive_outcomes import OF_A_PROBE, cells_of, play_again, world_at
from gates.rederive_shadow import TaskSection
from gates.stated import compare_keys, compare_rows, refuse, root_seed, section, training_seed
from gates.stress.monitors import ALARMS, MONITORS, THRESHOLDS
from genpolicy.evidence.monitors.alarms import alarm_rows, threshold_rows
from genpolicy.evidence.monitors.plan import (
    judging,
    setting_thresholds,
    start_hashes,
    starts_of,
)
from genpolicy.evidence.monitors.settings import MonitorsSettings
from genpolicy.evidence.rows.monitors import MonitorScoreRow
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.integrity.rows import read_rows
from genpolicy.integrity.tables import read_table
from genpolicy.tasks.api import Start, World, load_task
from genpolicy.verification.attended import attended_otherwise
from genpolicy.verification.expected import ExpectedSettings
from genpolicy.verification.journal_source import readable
from genpolicy.verification.motion import ExpectedMotion
from genpolicy.verification.rollouts import derived_with_recoveries

SCORES = "scores.parquet"
PHASE = ("method", "monitor", "phase")
OF_A_ROLLOUT = ("method", "monitor", "family", "severity", "start", "phase")
ROLLOUT = ("method", "perturbation", "start")


def rederive_monitors(
    root: Path, params: Mapping[str, Any], held_to: tuple[ExpectedSettings, ExpectedMotion]
) -> None:
    """Hold what Gate D prints of the monitors against scores and journals; nothing where none ran.

    Args:
        root: Root of the workspace.
        params: `params.yaml`.
        held_to: What every session must have declared, and what every executed row must keep to.

    Raises:
        RefusedError: A threshold or an alarm is not what the scores give, a rollout not what its
            journal says or begun elsewhere than planned, its recorded commands do not lead where it
            says, or a finding of the checker another.
        IntegrityError: A file is missing or no regular file.
        BadInputError: A file cannot be read.
    """
    folder = root / MONITORS
    if not folder.is_dir():
        return
    settings = section(params, "monitors", MonitorsSettings)
    task = load_task(section(params, "task", TaskSection).name)
    rollouts = read_rows(folder / "rollouts.parquet", RolloutRow)
    scores = read_rows(folder / "scores.parquet", MonitorScoreRow)
    above = threshold_rows(scores, rollouts, alpha=settings.alpha, phases=task.phases)
    alarms = alarm_rows(scores, rollouts, above, settings, contact_phases=task.contact_phases)
    for path, keys, again in ((THRESHOLDS, PHASE, above), (ALARMS, OF_A_ROLLOUT, alarms)):
        stated = read_table(root / path).to_pylist()
        derived = [asdict(row) for row in again]
        compare_rows("D", path, keys, stated, derived, seed=None, origin=SCORES)
    journals = sorted(folder.glob("journals/*.mcap"))
    with readable(f"{MONITORS}/journals"):
        ended = [row for path in journals for row in derived_with_recoveries(path)[0].values()]
    path = f"{MONITORS}/rollouts.parquet"
    rows = read_table(root / path).to_pylist()
    compare_rows("D", path, ROLLOUT, rows, ended, seed=training_seed(params))
    if not journals:
        return
    planned = start_hashes(task, settings, root_seed=root_seed(params))
    named = {f"{row.perturbation}/{row.start}/{row.start_sha256}": "" for row in rollouts}
    compare_keys("D", path, named, dict.fromkeys(planned, ""), "as planned")
    for journal in journals:
        with readable(f"{MONITORS}/journals/{journal.name}"):
            found = next(attended_otherwise(journal, None), None)
        if found is not None:
            refuse("D", journal.name, found, "nobody who comes, as planned")
    rederive_checked(root, "D", MONITORS, held_to, journals)
    rederive_probed_outcomes(params, journals)


def rederive_probed_outcomes(params: Mapping[str, Any], journals: Sequence[Path]) -> None:
    """Play a sample of the rollouts of the monitors again, under their probes; nobody pushes there.

    Raises:
        RefusedError: As of the comparison.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A journal is missing or no regular file.
        BadInputError: A journal cannot be read.
    """
    settings, seed = section(params, "monitors", MonitorsSettings), root_seed(params)
    task = load_task(section(params, "task", TaskSection).name)
    conditions = {one.name: one for one in (*setting_thresholds(settings), *judging(settings))}

    @cache
    def starts_of_kind(kind: str, count: int) -> list[Start]:
        texts = starts_of(task, kind, root_seed=seed, count=count)
        return [task.start_from_json(text) for text in texts]

    def begin(labels: Mapping[str, str]) -> World:
        one = conditions[labels["perturbation"]]
        return world_at(task, starts_of_kind(one.kind, one.count), labels, one.probe)

    play_again(cells_of("D", task, params, begin), journals, OF_A_PROBE, pushed=False)
