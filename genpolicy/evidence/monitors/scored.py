"""Scores, from journals: what an invocation saw is read there, and what it drew is drawn again.

So a score exists only after its rollout has ended, and nothing in a rollout can ask for one.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.contenders import Contender, opened
from genpolicy.candidates.judged import GENERATORS, JudgedPolicy, candidates_of, trained
from genpolicy.contract.chunk import actions_sha256, raw_actions
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import GenpolicyError, IntegrityError
from genpolicy.evidence.monitors.settings import MonitorsSettings
from genpolicy.evidence.rows.monitors import MonitorScoreRow, MonitorUnavailableRow
from genpolicy.evidence.stress.shard import Shard
from genpolicy.execution.journal import Event, read_journal
from genpolicy.execution.nanoseconds import NS_PER_S
from genpolicy.monitors.protocol import Fit, Invocation, Monitor, Unavailable
from genpolicy.monitors.registry import MONITORS, READ_DRAWS
from genpolicy.policies.matched_training import training_windows
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.protocol import NoiseName, Policy
from genpolicy.tasks.api import Task, load_task

Array = NDArray[np.float64]

DATASET = "ingest"
FAILS = (GenpolicyError, ArithmeticError, ValueError, RuntimeError)
"""How a monitor fails: numbers that are none, or a fit that does not come about."""
OTHERWISE = "it does not draw the same again"


@dataclass(frozen=True)
class Scoring:
    """The rollouts of one method, to be scored by some monitors.

    Attributes:
        task: Registered name of the task.
        judged: The method's policy.
        others: The same method from other training seeds.
        dataset: Folder of the dataset; its training split is what monitors are fitted on.
        samples: Candidates per invocation, as in the rollouts.
        monitors: Who scores, in order.
        journals: Journals of the rollouts.
    """

    task: str
    judged: Contender
    others: tuple[JudgedPolicy, ...]
    dataset: Path
    samples: int
    monitors: tuple[str, ...]
    journals: tuple[Path, ...]


@dataclass(frozen=True)
class Scored:
    """What comes of it: scores, and who could not score."""

    scores: list[MonitorScoreRow]
    unavailable: list[MonitorUnavailableRow]


@dataclass(frozen=True)
class _Seen:
    """An invocation as its journal states it."""

    condition: str
    start: int
    number: int
    time_s: float
    history: Array
    key: NoiseName
    drawn_sha256: str


def scorings(
    shards: Sequence[Shard],
    settings: MonitorsSettings,
    *,
    artifacts: Path,
    other_seeds: Sequence[int],
) -> list[Scoring]:
    """One scoring per method, of all of its journals.

    Args:
        shards: Rollouts that were run.
        settings: Section `monitors`.
        artifacts: Folder of the stages' outputs.
        other_seeds: Training seeds beside the one that is judged.

    Raises:
        BadInputError: A checkpoint of another seed is missing or malformed.
    """
    methods = {shard.judged.name: shard for shard in shards}
    return [
        Scoring(
            task=shard.comparison.task,
            judged=shard.judged,
            others=_others(shard.judged, artifacts, other_seeds),
            dataset=artifacts / DATASET,
            samples=shard.comparison.samples,
            monitors=settings.watching,
            journals=tuple(own.journal for own in shards if own.judged.name == name),
        )
        for name, shard in methods.items()
    ]


def _others(judged: Contender, artifacts: Path, seeds: Sequence[int]) -> tuple[JudgedPolicy, ...]:
    if not isinstance(judged, JudgedPolicy):
        return ()
    return tuple(trained(artifacts / GENERATORS, [judged.name], seeds=seeds, device=judged.device))


def score_method(scoring: Scoring) -> Scored:
    """Fit every monitor on the training split and score every invocation of the journals.

    A monitor that fails, at its fit or at a score, has no scores here, and says why: nothing is
    judged by one, so that none may keep the others or the verdict waiting.

    Raises:
        IntegrityError: A journal, or what was drawn, is not what it was.
    """
    task = load_task(scoring.task)
    name = scoring.judged.name
    with opened(scoring.judged, task.observation, scene=task.scene_path) as policy:
        monitors = _fitted(scoring, policy)
        scores = [
            row
            for path in scoring.journals
            for row in _scores(_invocations(path), scoring, policy, monitors, task)
        ]
    absent = {
        monitor: MonitorUnavailableRow(name, monitor, found.why)
        for monitor, found in monitors.items()
        if isinstance(found, Unavailable)
    }
    return Scored([row for row in scores if row.monitor not in absent], [*absent.values()])


def _fitted(scoring: Scoring, policy: Policy) -> dict[str, Monitor | Unavailable]:
    data = load_dataset(scoring.dataset)
    fit = Fit(
        windows=training_windows(data, "train", policy.horizons),
        normalisation=data.normalisation,
        action_period_s=policy.horizons.action_period_s,
        policy=policy if isinstance(policy, NetworkPolicy) else None,
        others=[other.load() for other in scoring.others],
        candidates=candidates_of(policy, scoring.samples),
    )
    return {monitor: _fit(monitor, fit) for monitor in scoring.monitors}


def _fit(name: str, fit: Fit) -> Monitor | Unavailable:
    try:
        return MONITORS[name](fit)
    except IntegrityError:
        raise
    except FAILS as error:
        return Unavailable(f"its fit failed: {error}")


def _invocations(path: Path) -> list[_Seen]:
    """Every invocation of a journal, by rollout and in order."""
    return [seen for events in read_journal(path).values() for seen in _of_session(events)]


def _of_session(events: Sequence[Event]) -> Iterator[_Seen]:
    labels = next(event.payload["labels"] for event in events if event.kind == "session")
    drawn = {
        event.payload["chunk_id"]: event.payload["measures"].get("drawn_sha256", "")
        for event in events
        if event.kind == "candidate" and event.payload["index"] == 0
    }
    conditioned = [event for event in events if event.kind == "conditioning"]
    for number, event in enumerate(conditioned):
        payload = event.payload
        flat = np.frombuffer(bytes.fromhex(payload["history"]), dtype="<f8")
        yield _Seen(
            condition=labels["perturbation"],
            start=int(labels["start"]),
            number=number,
            time_s=event.t / NS_PER_S,
            history=flat.reshape(payload["rows"], -1),
            key=tuple(payload["key"]),
            drawn_sha256=drawn.get(payload["id"], ""),
        )


def _scores(
    seen: Sequence[_Seen],
    scoring: Scoring,
    policy: Policy,
    monitors: dict[str, Monitor | Unavailable],
    task: Task,
) -> Iterator[MonitorScoreRow]:
    if not seen:
        return
    drawn = policy.sample(
        np.stack([one.history for one in seen]),
        noise_names=[one.key for one in seen],
        candidates=candidates_of(policy, scoring.samples),
    ).actions
    before: dict[int, Invocation] = {}
    for one, chunks in zip(seen, drawn, strict=True):
        if not _is_same(scoring, one, chunks):
            gone = Unavailable(f"{_at(one)}: {OTHERWISE}")
            known = [n for n, found in monitors.items() if not isinstance(found, Unavailable)]
            monitors.update(dict.fromkeys([n for n in known if n in READ_DRAWS], gone))
        if not np.isfinite(chunks).all():  # the first layer rejected it; nobody scores it
            continue
        invocation = Invocation(one.time_s, one.history, chunks, before.get(one.start))
        before[one.start] = Invocation(one.time_s, one.history, chunks)
        for name, monitor in monitors.items():
            if isinstance(monitor, Unavailable):
                continue
            score = _score(monitor, invocation)
            if isinstance(score, Unavailable):
                monitors[name] = Unavailable(f"{_at(one)}: {score.why}")
                continue
            yield MonitorScoreRow(
                method=scoring.judged.name,
                condition=one.condition,
                start=one.start,
                invocation=one.number,
                time_s=one.time_s,
                phase=task.phase_of(one.history[-1]),
                monitor=name,
                score=score,
            )


def _at(one: _Seen) -> str:
    return f"{one.condition}, start {one.start}, invocation {one.number}"


def _is_same(scoring: Scoring, one: _Seen, chunks: Array) -> bool:
    """Whether this is what was drawn; invocations that nobody judged say nothing of it.

    Raises:
        IntegrityError: It is not, and the policy runs here, from bound files.
    """
    same = not one.drawn_sha256 or actions_sha256(raw_actions(chunks[0])) == one.drawn_sha256
    if not same and isinstance(scoring.judged, JudgedPolicy):
        raise IntegrityError(
            where=f"{scoring.judged.name}: {one.condition}, start {one.start}",
            found=f"another chunk than was drawn by invocation {one.number}",
            expected="the same from the same observations and noise",
            action="Run `dvc repro monitors` on the machine that ran stress.",
        )
    return same


def _score(monitor: Monitor, invocation: Invocation) -> float | Unavailable:
    try:
        score = monitor.score(invocation)
    except IntegrityError:
        raise
    except FAILS as error:
        return Unavailable(f"it failed: {error}")
    return score if np.isfinite(score) else Unavailable(f"its score was {score}")
