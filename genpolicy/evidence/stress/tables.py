"""Gate D's evidence: the matched comparison as tables, journals, checker and power."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.contenders import Contender
from genpolicy.candidates.joining import DRAWN_ON
from genpolicy.candidates.judged import JudgedPolicy
from genpolicy.compute import map_shards
from genpolicy.errors import ConfigError
from genpolicy.evidence.blocks_run import blocks_document
from genpolicy.evidence.documents.given import Distilled
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.documents.stress import BLOCKS, DISTILLED, ENVELOPE
from genpolicy.evidence.rows.brought import FixtureAgainRow
from genpolicy.evidence.rows.stress import (
    AgeRow,
    ConservationRow,
    FaultRow,
    InvocationRow,
    OverrunRow,
    RecoveryRow,
    RefusedRow,
    RolloutRow,
    SpliceRow,
    StressCountRow,
    StressStubRow,
)
from genpolicy.evidence.shadow.tables import account_rows, checker_document
from genpolicy.evidence.stress.envelope import envelope_document, require_tighter
from genpolicy.evidence.stress.in_blocks import run_in_blocks
from genpolicy.evidence.stress.latency import LatencyModel
from genpolicy.evidence.stress.matched import run_shard
from genpolicy.evidence.stress.perturbations import Perturbation, ReducedEnvelope
from genpolicy.evidence.stress.shard import Comparison, Shard, ShardResult
from genpolicy.feasibility.cell import cell_of
from genpolicy.integrity.rows import write_rows
from genpolicy.statistics.planned_blocks import Rule
from genpolicy.statistics.possible import seen_of
from genpolicy.tasks.api import load_task
from genpolicy.verification.commands import reach_of

AGE_LEVELS = (0.0, 0.05, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99, 1.0)


def write_stress(
    folder: Path,
    shards: Sequence[Shard],
    *,
    workers: int,
    scheduler: str,
    rule: Rule | None = None,
) -> dict[str, int]:
    """Run every shard and write tables, journals and what the checker says of them.

    Args:
        folder: Existing folder; shards write their journals below `journals`.
        shards: One per method and perturbation.
        workers: Local processes.
        scheduler: `local` or the address of a Dask scheduler.
        rule: Says who can no longer pass and runs no further; None: all run all of their starts.

    Returns:
        How many starts each method ran.
    """
    (folder / "journals").mkdir()
    if rule is None:
        results = map_shards(run_shard, shards, workers=workers, scheduler=scheduler)
    else:
        (parts := folder / "parts").mkdir()
        results = run_in_blocks(shards, rule, parts=parts, workers=workers, scheduler=scheduler)
        parts.rmdir()
        seen = seen_of((row for result in results for row in result.rollouts), rule)
        BLOCKS.write(folder, blocks_document(rule, seen))
    _write_tables(folder, list(zip(shards, results, strict=True)))
    return {
        shard.judged.name: len(result.rollouts)
        for shard, result in zip(shards, results, strict=True)
    }


def _write_tables(folder: Path, pairs: Sequence[tuple[Shard, ShardResult]]) -> None:
    rollouts = [row for _, result in pairs for row in result.rollouts]
    write_rows(folder / "rollouts.parquet", RolloutRow, rollouts)
    invocations = [row for _, result in pairs for row in result.invocations]
    write_rows(folder / "invocations.parquet", InvocationRow, invocations)
    splices = [row for _, result in pairs for row in result.splices]
    write_rows(folder / "splices.parquet", SpliceRow, splices)
    recoveries = [row for _, result in pairs for row in result.recoveries]
    write_rows(folder / "recoveries.parquet", RecoveryRow, recoveries)
    refused = [row for _, result in pairs for row in result.refused]
    write_rows(folder / "refused.parquet", RefusedRow, refused)
    counts: list[StressCountRow] = []
    balances: list[ConservationRow] = []
    for shard, result in pairs:
        rows = account_rows(result.accounts)
        counts += [
            StressCountRow(**_key(shard), reason=row["reason"], count=row["count"]) for row in rows
        ]
        discarded = sum(sum(account.discarded.values()) for account in result.accounts)
        balances.append(
            ConservationRow(
                method=shard.judged.name,
                perturbation=shard.perturbation,
                generated=rows[0]["generated"],
                executed=rows[0]["executed"],
                queued=rows[0]["queued"],
                discarded=discarded,
            )
        )
    write_rows(folder / "counts.parquet", StressCountRow, counts)
    write_rows(folder / "conservation.parquet", ConservationRow, balances)
    write_rows(folder / "stub.parquet", StressStubRow, [result.stub for _, result in pairs])
    overruns = [row for _, result in pairs for row in result.overruns]
    write_rows(folder / "overruns.parquet", OverrunRow, overruns)
    _write_faults(folder, pairs)
    again = [row for _, result in pairs for row in result.again]
    write_rows(folder / "fixtures.parquet", FixtureAgainRow, again)
    ages = [row for shard, result in pairs for row in _age_rows(shard, result)]
    write_rows(folder / "ages.parquet", AgeRow, ages)
    shards = [shard for shard, _ in pairs]
    journals = [shard.journal for shard in shards]
    comparison = shards[0].comparison
    task = load_task(comparison.task)
    period_s = comparison.cell.horizons.action_period_s
    robot = cell_of(task, comparison.feasibility, action_period_s=period_s)
    checked = checker_document(journals, cell=comparison.cell, robot=robot, task=task)
    CHECKER.write(folder, checked)
    _write_envelope(folder, shards)
    write_distilled(folder, [shard.judged for shard in shards])


def _write_faults(folder: Path, pairs: Sequence[tuple[Shard, ShardResult]]) -> None:
    """`faults.parquet`, where a policy in a process of its own was compared."""
    asked = [result for shard, result in pairs if isinstance(shard.judged, BroughtPolicy)]
    if asked:
        rows = [row for result in asked for row in result.faults]
        write_rows(folder / "faults.parquet", FaultRow, rows)


def _write_envelope(folder: Path, shards: Sequence[Shard]) -> None:
    """`envelope.json`, where a condition ran inside the card's envelope."""
    inside = [shard for shard in shards if isinstance(shard.schedule, ReducedEnvelope)]
    if not inside:
        return
    reached = {shard.judged.name: reach_of(shard.journal) for shard in inside}
    first = inside[0]
    assert isinstance(first.schedule, ReducedEnvelope)
    ENVELOPE.write(folder, envelope_document(first.perturbation, first.schedule, reached))


def write_distilled(folder: Path, judged: Iterable[Contender]) -> None:
    """`distilled.json`, where a compared policy has a teacher: which, and what it took.

    What it took to make a policy that was brought, nobody here knows.

    Raises:
        IntegrityError: The files of a policy are not those of its identity.
        BadInputError: They are missing, or the place cannot be written.
    """
    found = {}
    ours = {one.name: one for one in judged if isinstance(one, JudgedPolicy)}
    for policy in ours.values():
        said = policy.load().checkpoint.config.distilled
        if said is not None:
            found[policy.name] = Distilled(**said.model_dump())
    if found:
        DISTILLED.write(folder, found)


def plan_shards(
    comparison: Comparison,
    judged: Sequence[Contender],
    perturbations: Mapping[str, Perturbation],
    *,
    latency: Mapping[str, LatencyModel],
    journals: Path,
) -> list[Shard]:
    """Every method under every perturbation, perturbations outermost.

    Args:
        comparison: What all share.
        judged: Who is compared.
        perturbations: What is injected, by name.
        latency: Latency of each method.
        journals: Folder of the journals.

    Raises:
        ConfigError: A method whose latency was not measured, an envelope that is looser than the
            cell, a person for whom nobody waits as long, or a rule of joining that a method cannot
            keep and is not exempt from.
    """
    for schedule in perturbations.values():
        if isinstance(schedule, ReducedEnvelope):
            require_tighter(schedule, load_task(comparison.task), comparison.feasibility)
    untimed = sorted({policy.name for policy in judged} - set(latency))
    if untimed:
        raise ConfigError(
            where="params.yaml: stress.baselines, train_generators.samplers, candidates",
            found=f"with {', '.join(untimed)}, whose latency was not measured",
            expected=f"methods out of {', '.join(sorted(latency))}",
            action="Correct the names, or run `dvc repro latency`.",
        )
    waits_s = comparison.cell.execution.human_timeout_s
    if comparison.person is not None and not comparison.person.reaction_s[1] <= waits_s:
        raise ConfigError(
            where="params.yaml: stress.person.reaction_s",
            found=f"up to {comparison.person.reaction_s[1]:g} s",
            expected=f"at most execution.human_timeout_s, {waits_s:g} s",
            action="Let recovery wait for longer, or have the person come sooner.",
        )
    for policy in judged if comparison.joining.rule in DRAWN_ON else ():
        if isinstance(policy, JudgedPolicy):  # a server says it when it is asked
            comparison.joining.of(policy.name, guided=policy.load().guided)
    return [
        Shard(
            comparison=comparison,
            judged=policy,
            latency=latency[policy.name],
            perturbation=name,
            schedule=schedule,
            journal=journals / f"{policy.name}__{name}.mcap",
        )
        for (name, schedule), policy in product(perturbations.items(), judged)
    ]


def _key(shard: Shard) -> dict[str, str]:
    return {"method": shard.judged.name, "perturbation": shard.perturbation}


def _age_rows(shard: Shard, result: ShardResult) -> list[AgeRow]:
    """Quantiles of the action age over all rollouts of a shard."""
    if len(result.ages_s) == 0:
        return []
    return [
        AgeRow(
            **_key(shard),
            level=level,
            action_age_s=float(np.quantile(result.ages_s, level, method="higher")),
            actions=len(result.ages_s),
        )
        for level in AGE_LEVELS
    ]
