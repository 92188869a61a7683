"""The rows that a shard's rollouts are written down as."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from genpolicy.evidence.rows.stress import (
    FaultRow,
    InvocationRow,
    OverrunRow,
    RecoveryRow,
    RolloutRow,
    SpliceRow,
)
from genpolicy.evidence.stress.person import person_s
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.shard import Shard
from genpolicy.evidence.stress.state import Outcome

Array = NDArray[np.float64]

NS_PER_S = 1e9


def rollout_row(
    shard: Shard, rollout: Rollout, recoveries: Sequence[RecoveryRow]
) -> tuple[RolloutRow, Array]:
    """One row of `rollouts.parquet`, and the ages of its actions, computed from the journal.

    Args:
        shard: Whose rollout it is.
        rollout: One that has ended.
        recoveries: Its rows of `recoveries.parquet`, in the order of entry.
    """
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
        recovered=bool(recoveries) and recoveries[-1].recovered,
        interventions=rollout.person.calls,
        person_s=person_s(events),
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
