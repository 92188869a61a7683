"""The matched comparison: every method on the same starts under the same perturbations.

A shard is one method under one perturbation on all starts. Its worlds are stepped in lockstep and
share the network's batches; which batch a sample was drawn in changes no bit of it.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.contenders import Contender, Running, joining_of, opened
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.judged import candidates_of
from genpolicy.candidates.wire.policy import WireSamples
from genpolicy.evidence.fixtures_again import NO_FIXTURES, asked_again
from genpolicy.evidence.rows.brought import AFTER, BEFORE, FixtureAgainRow
from genpolicy.evidence.rows.stress import (
    FaultRow,
    InvocationRow,
    OverrunRow,
    RolloutRow,
    SpliceRow,
    StressStubRow,
)
from genpolicy.evidence.stress.envelope import checker_under
from genpolicy.evidence.stress.latency import LatencyModel
from genpolicy.evidence.stress.perturbations import Perturbation
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.state import Outcome, Setup
from genpolicy.execution.cell import Cell
from genpolicy.execution.journal import write_journal
from genpolicy.execution.ledger import Account
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.policies.guidance import Prefix
from genpolicy.policies.protocol import Policy
from genpolicy.seeds import stream
from genpolicy.tasks.api import Start, Task, load_task

Array = NDArray[np.float64]

NS_PER_S = 1e9


@dataclass(frozen=True)
class Comparison:
    """What all shards share.

    Attributes:
        task: Registered name of the task.
        starts: Initial states as JSON texts, in order.
        episode_limit_s: Longest rollout.
        samples: Candidates per invocation of a stochastic method.
        cell: Horizons, executor, supervisor and recovery.
        feasibility: Thresholds of the six layers.
        root_seed: Root seed.
        joining: How chunks join.
        fixtures: Those of Gate B, for who was brought. Shape (F, H_o, D_o).
    """

    task: str
    starts: tuple[str, ...]
    episode_limit_s: float
    samples: int
    cell: Cell
    feasibility: FeasibilitySettings
    root_seed: int
    joining: JoiningSettings = field(default_factory=JoiningSettings)
    fixtures: Array = field(default_factory=lambda: NO_FIXTURES, compare=False)


@dataclass(frozen=True)
class Shard:
    """One method under one perturbation.

    Attributes:
        comparison: What all shards share.
        judged: The method's policy.
        latency: Latency of the method.
        perturbation: Name of the perturbation.
        schedule: What it injects.
        journal: File to write the journal to.
    """

    comparison: Comparison
    judged: Contender
    latency: LatencyModel
    perturbation: str
    schedule: Perturbation
    journal: Path


@dataclass(frozen=True)
class ShardResult:
    """Rows of a shard.

    Attributes:
        rollouts: One row per start.
        invocations: One row per invocation.
        splices: One row per chunk that entered a queue.
        overruns: One row per term that took longer than it may.
        faults: One row per kind in which the policy's process failed.
        accounts: Balance of chunks, per rollout.
        ages_s: Every action age, s.
        stub: Arrivals, stale and invalid offers.
        again: Gate B's fixtures, before and after; none of what runs here.
    """

    rollouts: list[RolloutRow]
    invocations: list[InvocationRow]
    splices: list[SpliceRow]
    overruns: list[OverrunRow]
    faults: list[FaultRow]
    accounts: list[Account]
    ages_s: Array
    stub: StressStubRow
    again: list[FixtureAgainRow] = field(default_factory=list)


def matched_starts(task: Task, *, root_seed: int, count: int) -> list[Start]:
    """Initial states of the comparison; start i does not depend on how many there are."""
    return [task.sample_start(stream(root_seed, "starts", index)) for index in range(count)]


def run_shard(shard: Shard) -> ShardResult:
    """All rollouts of a shard, in lockstep; writes its journal."""
    task = load_task(shard.comparison.task)
    with opened(shard.judged, task.observation, scene=task.scene_path) as policy:
        before = _again(shard, policy, BEFORE)
        result = _run(shard, task, policy)
        return replace(result, again=[*before, *_again(shard, policy, AFTER)])


def _again(shard: Shard, policy: Policy, when: str) -> list[FixtureAgainRow]:
    fixtures = shard.comparison.fixtures
    return asked_again(policy, fixtures, condition=shard.perturbation, when=when)


def _run(shard: Shard, task: Task, policy: Running) -> ShardResult:
    comparison = shard.comparison
    horizons = comparison.cell.horizons
    joining = joining_of(comparison.joining, policy)
    setup = Setup(
        task=task,
        checker=checker_under(
            shard.schedule,
            task,
            comparison.feasibility,
            action_period_s=horizons.action_period_s,
        ),
        horizons=horizons,
        execution=comparison.cell.execution,
        latency=shard.latency,
        perturbation=shard.perturbation,
        schedule=shard.schedule,
        root_seed=comparison.root_seed,
        method=shard.judged.name,
        checkpoint=policy.checkpoint_hash,
        sampler=joining.sampler_hash(policy.sampler_config_hash),
        joining=joining,
    )
    epoch = task.calibration_epochs[-1]
    rollouts = [
        Rollout(setup, task.start_from_json(text), index, calibration_epoch=epoch)
        for index, text in enumerate(comparison.starts)
    ]
    ticks = round(comparison.episode_limit_s / horizons.action_period_s)
    for _ in range(ticks):
        active = [rollout for rollout in rollouts if not rollout.done]
        if not active:
            break
        step(active, policy, samples=comparison.samples)
    for rollout in rollouts:
        rollout.end(Outcome.TIMEOUT)
    write_journal(shard.journal, [rollout.journal for rollout in rollouts])
    parts = [rollout_row(shard, rollout) for rollout in rollouts]
    return ShardResult(
        rollouts=[row for row, _ in parts],
        invocations=[row for rollout in rollouts for row in invocation_rows(shard, rollout)],
        splices=[row for rollout in rollouts for row in splice_rows(shard, rollout)],
        overruns=overrun_rows(shard, rollouts),
        faults=fault_rows(shard, rollouts),
        accounts=[rollout.executor.conservation().chunks for rollout in rollouts],
        ages_s=np.concatenate([ages for _, ages in parts]),
        stub=StressStubRow(
            method=shard.judged.name,
            perturbation=shard.perturbation,
            arrivals=sum(rollout.stub.arrivals for rollout in rollouts),
            stale=sum(rollout.stub.stale for rollout in rollouts),
            invalid=sum(rollout.stub.invalid for rollout in rollouts),
        ),
    )


def step(active: Sequence[Rollout], policy: Policy, *, samples: int) -> None:
    """One tick of rollouts in lockstep; what they ask for is sampled in one batch.

    Args:
        active: Rollouts that have not ended, of one method and perturbation.
        policy: Their policy.
        samples: Candidates per invocation, if it is stochastic.
    """
    for rollout in active:
        rollout.sense()
    _judge_deliveries(active)
    for rollout in active:
        if not rollout.done:
            rollout.decide()
    asking = [rollout for rollout in active if rollout.wanted is not None]
    if asking:
        drawn = policy.sample(
            np.stack([rollout.conditioning() for rollout in asking]),
            noise_names=[rollout.noise_name for rollout in asking],
            candidates=candidates_of(policy, samples),
            prefix=_prefix(asking),
        )
        faults = drawn.faults if isinstance(drawn, WireSamples) else (None,) * len(asking)
        for rollout, chunks, fault in zip(asking, drawn.actions, faults, strict=True):
            assert rollout.wanted is not None
            if fault is None:
                rollout.wanted.chunks = chunks
            else:
                rollout.wanted.fault = str(fault)
    for rollout in active:
        if not rollout.done:
            rollout.act()


def _prefix(asking: Sequence[Rollout]) -> Prefix | None:
    """What the samples of these rollouts go on from; None under a rule that gives them nothing."""
    given = [wanted.prefix for rollout in asking if (wanted := rollout.wanted) and wanted.prefix]
    if not given:
        return None
    actions, weights = (np.stack(parts) for parts in zip(*given, strict=True))
    return Prefix(actions, weights, asking[0].setup.joining.guidance)


def _judge_deliveries(active: Sequence[Rollout]) -> None:
    """Feasibility of everything that arrived, one candidate per rollout and batch."""
    checker = active[0].setup.checker
    while True:
        asked = [(rollout, rollout.pending()) for rollout in active]
        open_ones = [(rollout, question) for rollout, question in asked if question is not None]
        if not open_ones:
            return
        results = checker.admit_many(
            [proposal for _, (proposal, _) in open_ones], [context for _, (_, context) in open_ones]
        )
        for (rollout, _), result in zip(open_ones, results, strict=True):
            rollout.settle(result)


def rollout_row(shard: Shard, rollout: Rollout) -> tuple[RolloutRow, Array]:
    """One row of `rollouts.parquet`, and the ages of its actions, computed from the journal."""
    events = rollout.journal.events()
    ages = np.array(
        [event.payload["age_ns"] / NS_PER_S for event in events if event.kind == "accept"]
    )
    balance = rollout.executor.conservation().chunks
    tally = rollout.tally
    assert rollout.outcome is not None
    row = RolloutRow(
        method=shard.judged.name,
        seed=shard.judged.seed,
        perturbation=shard.perturbation,
        start=rollout.start_index,
        start_sha256=rollout.start_sha256,
        outcome=str(rollout.outcome),
        success=rollout.outcome is Outcome.SUCCESS,
        duration_s=rollout.now_s,
        ticks=rollout.tick,
        action_ticks=tally.action_ticks,
        hold_ticks=tally.hold_ticks,
        fallback_ticks=tally.fallback_ticks,
        invocations=rollout.invocations,
        deadline_misses=tally.deadline_misses,
        discards=sum(balance.discarded.values()),
        rejections=tally.rejections,
        rejected_by=_most_common(tally.rejected_by),
        recovery_attempted=rollout.recovery.attempts > 0,
        recovered=rollout.recovery.attempts > 0 and rollout.outcome is Outcome.SUCCESS,
        interventions=tally.interventions,
        action_age_p50_s=_quantile(ages, 0.5),
        action_age_p95_s=_quantile(ages, 0.95),
        action_age_max_s=_quantile(ages, 1.0),
        latency_p95_s=_quantile(np.array(tally.latencies_s), 0.95),
        force_peak_n=tally.force_peak_n,
        mode=tally.mode,
    )
    return row, ages


def invocation_rows(shard: Shard, rollout: Rollout) -> list[InvocationRow]:
    """Rows of `invocations.parquet`, in the order in which they began."""
    return [
        InvocationRow(
            method=shard.judged.name,
            seed=shard.judged.seed,
            perturbation=shard.perturbation,
            start=rollout.start_index,
            invocation=number,
            latency_s=latency_s,
        )
        for number, latency_s in enumerate(rollout.tally.latencies_s)
    ]


def splice_rows(shard: Shard, rollout: Rollout) -> list[SpliceRow]:
    """Rows of `splices.parquet`, in the order in which the chunks entered the queue."""
    return [
        SpliceRow(
            method=shard.judged.name,
            seed=shard.judged.seed,
            perturbation=shard.perturbation,
            start=rollout.start_index,
            rule=rollout.setup.joining.rule,
            **vars(splice),
        )
        for splice in rollout.splices
    ]


def overrun_rows(shard: Shard, rollouts: Sequence[Rollout]) -> list[OverrunRow]:
    """Rows of `overruns.parquet`, sorted: what was done how often, over all rollouts."""
    done: Counter[tuple[str, str]] = Counter()
    for rollout in rollouts:
        done.update(rollout.tally.overruns)
    return [
        OverrunRow(
            method=shard.judged.name,
            perturbation=shard.perturbation,
            term=str(term),
            action=str(action),
            count=count,
        )
        for (term, action), count in sorted(done.items()) or [(("", ""), 0)]
    ]


def fault_rows(shard: Shard, rollouts: Sequence[Rollout]) -> list[FaultRow]:
    """Rows of `faults.parquet`, sorted: how often which fault cost an answer."""
    found: Counter[str] = Counter()
    for rollout in rollouts:
        found.update(rollout.tally.faults)
    rows = sorted(found.items()) or [("", 0)]
    return [FaultRow(shard.judged.name, shard.perturbation, *row) for row in rows]


def _quantile(values: Array, level: float) -> float | None:
    """Order statistic; None where nothing was recorded, never 0."""
    if len(values) == 0:
        return None
    return float(np.quantile(values, level, method="higher"))


def _most_common(counts: Mapping[str, int]) -> str:
    return max(sorted(counts), key=lambda name: counts[name], default="")
