"""One search: rollouts of a candidate in a condition, each where the optimiser asked for it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.contenders import Running, opened
from genpolicy.evidence.failure_search.conditions import Condition
from genpolicy.evidence.failure_search.optimiser import search
from genpolicy.evidence.failure_search.starts import chosen_start, coordinates_of
from genpolicy.evidence.failure_search.worth import worth
from genpolicy.evidence.rows.failures import SearchedRow
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.evidence.stress.matched import run_out, setup_of
from genpolicy.evidence.stress.recoveries import recovery_rows
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.shard import Shard
from genpolicy.evidence.stress.shard_rows import rollout_row
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.seeds import stream
from genpolicy.tasks.api import Task, load_task

Array = NDArray[np.float64]

STREAM = "failure_search"
"""Name below which everything is drawn that a search draws, beside what a rollout does."""


@dataclass(frozen=True)
class Searching:
    """One candidate in one condition.

    Attributes:
        shard: Who and what, as the comparison runs it; its starts are those that are asked for.
        condition: What is searched.
        evaluations: Rollouts, fixed beforehand.
    """

    shard: Shard
    condition: Condition
    evaluations: int


@dataclass(frozen=True)
class Asked:
    """One rollout that is asked for.

    Attributes:
        number: Count in its search, from 0; key of the draws of the rollout.
        point: What the optimiser asked for, in [0, 1].
        start: The start, as JSON.
        severity: Size of the condition; None where it has none.
    """

    number: int
    point: tuple[float, ...]
    start: str
    severity: float | None


@dataclass(frozen=True)
class Searched:
    """Every rollout of a search, in the order in which it was asked for.

    Attributes:
        rows: What was asked, and how it ended.
        rollouts: The same rollouts as the comparison would write them down.
        journals: What happened in them.
    """

    rows: list[SearchedRow]
    rollouts: list[RolloutRow]
    journals: list[Journal]


def generator_of(root_seed: int, method: str, condition: str) -> np.random.Generator:
    """The draws of one search: of none that judges, and of no other search."""
    return stream(root_seed, STREAM, method, condition)


def asked_for(
    task: Task, condition: Condition, points: Sequence[Array], *, first: int
) -> list[Asked]:
    """What points of the unit cube stand for.

    Args:
        task: Makes the starts.
        condition: Has the sizes.
        points: As the optimiser asks for them. Shape (coordinates of a start, and of a size,).
        first: Number of the first of them in its search.

    Raises:
        ConfigError: The task draws its starts in a way that cannot be chosen.
    """
    return [
        Asked(
            number=first + place,
            point=tuple(float(value) for value in point),
            start=chosen_start(task, point[: len(point) - condition.sizes]).to_json(),
            severity=condition.severity(float(point[-1])) if condition.sizes else None,
        )
        for place, point in enumerate(points)
    ]


def worth_of(
    condition: Condition,
    rollout: Mapping[str, Any],
    severity: float | None,
    *,
    episode_limit_s: float,
    execution: ExecutionSettings,
) -> float:
    """What the optimiser is told of a rollout.

    Args:
        condition: That was searched.
        rollout: The columns of its row.
        severity: Size of the condition; None where it has none.
        episode_limit_s: Longest rollout, s.
        execution: Has the limits of force. A phase in the open has a lower one than the largest; it
            is met by a stop, and not by coming close.
    """
    return worth(
        rollout,
        share=condition.share(severity),
        episode_limit_s=episode_limit_s,
        force_limit_n=max(execution.force_limit_n.values()),
    )


def search_with(
    task: Task,
    condition: Condition,
    evaluate: Callable[[Sequence[Asked]], Sequence[float]],
    *,
    method: str,
    evaluations: int,
    root_seed: int,
) -> None:
    """Ask for every rollout of a search, generation by generation; `evaluate` says its worth.

    Who tells the same worths again is asked for the same rollouts again. Of none nothing is asked,
    nor whether the starts of the task can be chosen.
    """
    if evaluations == 0:
        return
    counted = 0

    def of_points(points: Sequence[Array]) -> Sequence[float]:
        nonlocal counted
        asked = asked_for(task, condition, points, first=counted)
        counted += len(asked)
        return evaluate(asked)

    search(
        of_points,
        dimensions=coordinates_of(task) + condition.sizes,
        evaluations=evaluations,
        generator=generator_of(root_seed, method, condition.name),
    )


def run_search(searching: Searching) -> Searched:
    """Search, and write the journal of all its rollouts.

    Raises:
        ConfigError: The task draws its starts in a way that cannot be chosen.
    """
    shard = searching.shard
    task = load_task(shard.comparison.task)
    found = Searched([], [], [])
    with opened(shard.judged, task.observation, scene=task.scene_path) as policy:

        def evaluate(asked: Sequence[Asked]) -> list[float]:
            ended = run_asked(searching, task, policy, asked)
            found.rows.extend(ended.rows)
            found.rollouts.extend(ended.rollouts)
            found.journals.extend(ended.journals)
            return [row.worth for row in ended.rows]

        search_with(
            task,
            searching.condition,
            evaluate,
            method=shard.judged.name,
            evaluations=searching.evaluations,
            root_seed=shard.comparison.root_seed,
        )
    write_journal(shard.journal, found.journals)
    return found


def run_asked(
    searching: Searching, task: Task, policy: Running, asked: Sequence[Asked]
) -> Searched:
    """Run what was asked for, in lockstep; nothing of a rollout hangs on who runs beside it."""
    shard, condition = searching.shard, searching.condition
    setup = setup_of(shard, task, policy)
    rollouts = [
        Rollout(
            replace(setup, schedule=condition.at(one.severity)),
            task.start_from_json(one.start),
            one.number,
            calibration_epoch=task.calibration_epochs[-1],
        )
        for one in asked
    ]
    run_out(rollouts, policy, shard.comparison)
    ended = [rollout_row(shard, each, recovery_rows(shard, each))[0] for each in rollouts]
    return Searched(
        rows=[_row(searching, *each) for each in zip(asked, ended, strict=True)],
        rollouts=ended,
        journals=[rollout.journal for rollout in rollouts],
    )


def _row(searching: Searching, asked: Asked, ended: RolloutRow) -> SearchedRow:
    condition = searching.condition
    return SearchedRow(
        method=ended.method,
        seed=ended.seed,
        perturbation=ended.perturbation,
        of=condition.of,
        start=ended.start,
        point=asked.point,
        scene_start=asked.start,
        start_sha256=ended.start_sha256,
        field=condition.field,
        severity=asked.severity,
        most=condition.most if condition.sizes else None,
        outcome=ended.outcome,
        failed=not ended.success,
        worth=worth_of(
            condition,
            vars(ended),
            asked.severity,
            episode_limit_s=searching.shard.comparison.episode_limit_s,
            execution=searching.shard.comparison.cell.execution,
        ),
    )
