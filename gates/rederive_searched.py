"""What the failure search states, derived again: what was asked for, what came of it, and where.

The optimiser is asked again and told the worths that follow from the journals: it must ask for the
same points, so that no rollout can be left out, put in, or given another start. How the rollouts
ended follows from their journals, which the checker reads again. Not done again are the draws of
latency, disturbance and chunks of these rollouts, as they are of those that are judged: nothing is
judged by these, and `python -m stages.failure_search FILE` runs one of them again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from gates.card.searched import FAILURE_SEARCH, SEARCHED
from gates.rederive_checked import rederive_checked
from gates.rederive_outcomes import OF_A_PROBE, cells_of, play_again, world_at
from gates.rederive_sessions import rederive_sessions
from gates.rederive_shadow import TaskSection
from gates.report import read_report
from gates.reproducibility.settings import RELOAD
from gates.stated import compare_keys, compare_rows, refuse, root_seed, section, training_seed
from genpolicy.evidence.documents.failures import FAILURE, Failure
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.evidence.failure_search.conditions import Condition, searched_conditions
from genpolicy.evidence.failure_search.rollouts import Asked, asked_for, search_with, worth_of
from genpolicy.evidence.failure_search.settings import search_settings
from genpolicy.evidence.failure_search.tables import JOURNALS, ROLLOUTS, events_sha256
from genpolicy.evidence.rows.failures import FAILURES, SearchedRow, failure_name
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.journal import Event, read_journal
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.rows import read_rows
from genpolicy.integrity.tables import read_table
from genpolicy.tasks.api import Task, World, WorldSettings, load_task
from genpolicy.verification.expected import ExpectedSettings
from genpolicy.verification.journal_source import readable
from genpolicy.verification.motion import ExpectedMotion
from genpolicy.verification.rollouts import derived_with_recoveries

ROLLOUT = ("method", "perturbation", "start")
CLOSE = 1e-6
"""How far apart the same point may be: another machine factors a matrix otherwise."""


def rederive_searched(
    root: Path, params: Mapping[str, Any], held_to: tuple[ExpectedSettings, ExpectedMotion]
) -> None:
    """Hold what the card says of the failure search against its journals.

    Args:
        root: Root of the workspace.
        params: `params.yaml`.
        held_to: What every session must have declared, and what every executed row must keep to.

    Raises:
        RefusedError: A row, a rollout, the file of a failure or a finding of the checker is not
            what follows from the journals, a session was made by another policy, or the search
            would have asked for something else.
        IntegrityError: A file is missing or no regular file.
        BadInputError: A file cannot be read.
    """
    folder = root / FAILURE_SEARCH
    rows = read_rows(root / SEARCHED, SearchedRow)
    journals = sorted((folder / JOURNALS).glob("*.mcap"))
    with readable(f"{FAILURE_SEARCH}/{JOURNALS}"):
        ended = [row for path in journals for row in derived_with_recoveries(path)[0].values()]
    path, seed = f"{FAILURE_SEARCH}/{ROLLOUTS}", training_seed(params)
    compare_rows("E", path, ROLLOUT, read_table(root / path).to_pylist(), ended, seed=seed)
    again = _asked_again(root, params, rows, ended)
    stated = [asdict(row) for row in rows]
    compare_rows("E", SEARCHED, ROLLOUT, stated, again, seed=seed, origin="its search")
    rederive_sessions(root, "E", params, journals)
    _files(root, params, rows, journals)
    if journals:
        rederive_checked(root, "E", FAILURE_SEARCH, held_to, journals)
        rederive_searched_outcomes(params, rows, journals)


def rederive_searched_outcomes(
    params: Mapping[str, Any], rows: Sequence[SearchedRow], journals: Sequence[Path]
) -> None:
    """Play a sample of the rollouts of the failure search again, pushed as they say.

    Raises:
        RefusedError: As of the comparison.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A journal is missing or no regular file.
        BadInputError: A journal cannot be read.
    """
    task = load_task(section(params, "task", TaskSection).name)
    asked = {(row.method, row.perturbation, row.start): row.scene_start for row in rows}

    def begin(labels: Mapping[str, str]) -> World:
        number = int(labels["start"])
        text = asked[labels["method"], labels["perturbation"], number]
        return world_at(task, {number: task.start_from_json(text)}, labels)

    play_again(cells_of("E", task, params, begin), journals, OF_A_PROBE)


def _asked_again(
    root: Path,
    params: Mapping[str, Any],
    rows: Sequence[SearchedRow],
    ended: Sequence[Mapping[str, Any]],
) -> list[dict[str, Any]]:
    """Every row as the searches that are planned give it, by what the journals say."""
    evaluations = search_settings(params).evaluations
    settings = section(params, "stress", StressSettings)
    passed = [
        name for name, verdict in read_report(root, "D")[0].candidates.items() if verdict == "PASS"
    ]
    told = {(row.method, row.perturbation, row.start): row for row in rows}
    known = {(row["method"], row["perturbation"], row["start"]): row for row in ended}
    task = load_task(section(params, "task", TaskSection).name)
    execution = section(params, "execution", ExecutionSettings)
    found: list[dict[str, Any]] = []
    for condition in searched_conditions(settings):
        for method in passed:

            def evaluate(
                asked: Sequence[Asked], method: str = method, condition: Condition = condition
            ) -> list[float]:
                worths = []
                for one in asked:
                    key = (method, condition.name, one.number)
                    stated, end = told.get(key), known.get(key)
                    if stated is None or end is None:
                        refuse("E", f"{SEARCHED}: {key}", "missing", "a row and a rollout")
                    # Lengths first: points of unequal lengths cannot be subtracted.
                    if len(stated.point) != len(one.point) or not np.allclose(
                        stated.point, one.point, rtol=0.0, atol=CLOSE
                    ):
                        limit = f"{one.point}, which the search asks for"
                        refuse("E", f"{SEARCHED}: {key}: point", f"{stated.point}", limit)
                    row = _row(task, condition, stated, end)
                    began = f"{end['start_sha256']}"
                    if began != row["start_sha256"]:
                        limit = f"{row['start_sha256']}, at which its point begins"
                        refuse("E", f"{SEARCHED}: {key}: start of the journal", began, limit)
                    row["worth"] = worth_of(
                        condition,
                        end,
                        row["severity"],
                        episode_limit_s=settings.episode_limit_s,
                        execution=execution,
                    )
                    found.append(row)
                    worths.append(row["worth"])
                return worths

            search_with(
                task,
                condition,
                evaluate,
                method=method,
                evaluations=evaluations,
                root_seed=root_seed(params),
            )
    return found


def _row(
    task: Task, condition: Condition, stated: SearchedRow, end: Mapping[str, Any]
) -> dict[str, Any]:
    """The row of a rollout from its point and its journal; the world is made again."""
    (asked,) = asked_for(task, condition, [np.array(stated.point)], first=stated.start)
    world = task.make_world(
        task.start_from_json(asked.start),
        settings=WorldSettings(task.calibration_epochs[-1], seed=stated.start),
    )
    return {
        **asdict(stated),
        "of": condition.of,
        "scene_start": asked.start,
        "start_sha256": world.state_sha256(),
        "field": condition.field,
        "severity": asked.severity,
        "most": condition.most if condition.sizes else None,
        "outcome": end["outcome"],
        "failed": not end["success"],
    }


def _files(
    root: Path, params: Mapping[str, Any], rows: Sequence[SearchedRow], journals: Sequence[Path]
) -> None:
    """A file of each failure and no other, each of what its row and its journal say."""
    folder = root / FAILURE_SEARCH
    wanted = {failure_name(row): row for row in rows if row.failed}
    lying = sorted(path.name for path in (folder / FAILURES).glob("*"))
    where = f"{FAILURE_SEARCH}/{FAILURES}"
    compare_keys("E", where, dict.fromkeys(lying, ""), dict.fromkeys(wanted, ""), "as searched")
    sessions = {
        f"{session}.json".replace("/", "__"): events
        for path in journals
        for session, events in read_journal(path).items()
    }
    pinned = {name: one.checkpoint for name, one in CANDIDATES.read(root / RELOAD).items()}
    ran = {name: _checkpoint(events) for name, events in sessions.items()}
    named = {name: pinned.get(name.partition("__")[0]) for name in ran}
    compare_keys("E", f"{FAILURE_SEARCH}/{JOURNALS}", ran, named, "as Gate B pinned it")
    for name, row in wanted.items():
        stated: Failure = FAILURE.parse(read_json(folder / FAILURES / name), where=name)
        own = {
            "task": section(params, "task", TaskSection).name,
            "method": row.method,
            "checkpoint": ran[name],
            "training_seed": row.seed,
            "root_seed": root_seed(params),
            "condition": row.of,
            "perturbation": row.perturbation,
            "severity": row.severity,
            "number": row.start,
            "point": list(row.point),
            "start": row.scene_start,
            "start_sha256": row.start_sha256,
            "outcome": row.outcome,
            "events_sha256": events_sha256(sessions[name]),
        }
        compare_keys("E", f"{where}/{name}", FAILURE.plain(stated), own, "as searched")


def _checkpoint(events: Sequence[Event]) -> object:
    """Whose answers a session allows."""
    return next((one.payload.get("checkpoint") for one in events if one.kind == "active"), None)
