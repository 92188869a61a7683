"""The matched comparison: every method on the same starts under the same perturbations.

A shard is one method under one perturbation on all starts, or on a block of them. Its worlds are
stepped in lockstep and share the network's batches; which batch a sample was drawn in changes no
bit of it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from genpolicy.candidates.contenders import Running, joining_of, opened
from genpolicy.candidates.judged import candidates_of
from genpolicy.candidates.wire.policy import WireSamples
from genpolicy.evidence.fixtures_again import asked_again
from genpolicy.evidence.rows.brought import AFTER, BEFORE, FixtureAgainRow
from genpolicy.evidence.rows.stress import (
    StressStubRow,
)
from genpolicy.evidence.stress.envelope import checker_under
from genpolicy.evidence.stress.recoveries import recovery_rows
from genpolicy.evidence.stress.refused import refused_rows
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.shard import Comparison, Shard, ShardResult
from genpolicy.evidence.stress.shard_rows import (
    fault_rows,
    invocation_rows,
    overrun_rows,
    rollout_row,
    splice_rows,
)
from genpolicy.evidence.stress.state import Outcome, Setup
from genpolicy.execution.journal import write_journal
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.protocol import Policy
from genpolicy.seeds import stream
from genpolicy.tasks.api import Start, Task, load_task


def matched_starts(task: Task, *, root_seed: int, count: int) -> list[Start]:
    """Initial states of the comparison; start i does not depend on how many there are."""
    return [task.sample_start(stream(root_seed, "starts", index)) for index in range(count)]


def run_shard(shard: Shard, *, every: bool = False) -> ShardResult:
    """All rollouts of a shard, in lockstep; writes its journal.

    Args:
        shard: The shard.
        every: Whether refused candidates of every rollout are given, worth a look or not.
    """
    task = load_task(shard.comparison.task)
    with opened(shard.judged, task.observation, scene=task.scene_path) as policy:
        before = _again(shard, policy, BEFORE)
        result = _run(shard, task, policy, every=every)
        return replace(result, again=[*before, *_again(shard, policy, AFTER)])


def _again(shard: Shard, policy: Policy, when: str) -> list[FixtureAgainRow]:
    fixtures = shard.comparison.fixtures
    return asked_again(policy, fixtures, condition=shard.perturbation, when=when)


def setup_of(shard: Shard, task: Task, policy: Running) -> Setup:
    """What all rollouts of a shard share, under a policy that is asked.

    Raises:
        ConfigError: The envelope of the condition is looser than the cell.
    """
    comparison = shard.comparison
    horizons = comparison.cell.horizons
    joining = joining_of(comparison.joining, policy)
    return Setup(
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
        person=comparison.person,
        probe=shard.probe,
    )


def run_out(rollouts: Sequence[Rollout], policy: Policy, comparison: Comparison) -> None:
    """Advance rollouts in lockstep until each has ended, at the latest when its time is over."""
    ticks = round(comparison.episode_limit_s / comparison.cell.horizons.action_period_s)
    for _ in range(ticks):
        active = [rollout for rollout in rollouts if not rollout.done]
        if not active:
            break
        step(active, policy, samples=comparison.samples)
    for rollout in rollouts:
        rollout.end(Outcome.TIMEOUT)


def _run(shard: Shard, task: Task, policy: Running, *, every: bool) -> ShardResult:
    setup = setup_of(shard, task, policy)
    epoch, starts = task.calibration_epochs[-1], shard.comparison.starts
    rollouts = [
        Rollout(setup, task.start_from_json(starts[number]), number, calibration_epoch=epoch)
        for number in shard.numbers
    ]
    run_out(rollouts, policy, shard.comparison)
    write_journal(shard.journal, [rollout.journal for rollout in rollouts])
    recoveries = [recovery_rows(shard, rollout) for rollout in rollouts]
    refused = [rollout.refused for rollout in rollouts]
    parts = [rollout_row(shard, *each) for each in zip(rollouts, recoveries, strict=True)]
    return ShardResult(
        rollouts=[row for row, _ in parts],
        invocations=[row for rollout in rollouts for row in invocation_rows(shard, rollout)],
        splices=[row for rollout in rollouts for row in splice_rows(shard, rollout)],
        recoveries=[row for rows in recoveries for row in rows],
        overruns=overrun_rows(shard, rollouts),
        faults=fault_rows(shard, rollouts),
        refused=refused_rows([row for row, _ in parts], refused, setup.checker, every=every),
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
            np.stack([rollout.conditioning for rollout in asking]),
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
    joining = asking[0].setup.joining
    return Prefix(actions, weights, joining.guidance, joining.starts_at)


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
        for (rollout, (_, context)), result in zip(open_ones, results, strict=True):
            rollout.settle(result, context)
