"""The comparison in blocks of starts: who can no longer pass runs no further.

What is written is what one block of all starts would have given, byte for byte, of the starts that
were run: journals and rows of the blocks of a shard are put together in the order of the starts.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from genpolicy.compute import map_shards
from genpolicy.evidence.rows.stress import FaultRow, OverrunRow, RefusedRow, StressStubRow
from genpolicy.evidence.stress.matched import run_shard
from genpolicy.evidence.stress.shard import Shard, ShardResult
from genpolicy.evidence.stress.worth import kept_whole
from genpolicy.execution.journal import Event, Journal, read_journal, write_journal
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.statistics.planned_blocks import Rule
from genpolicy.statistics.possible import first_out, seen_of


@dataclass(frozen=True)
class Part:
    """One block of a shard.

    Attributes:
        shard: With its starts; its journal is that of the block.
        refused: File that takes its refused candidates.
    """

    shard: Shard
    refused: Path


@dataclass(frozen=True)
class Whole:
    """All blocks of a shard that were run.

    Attributes:
        shard: With the journal of them all.
        parts: Its blocks, in order.
        results: What came of each; without refused candidates.
    """

    shard: Shard
    parts: tuple[Part, ...]
    results: tuple[ShardResult, ...]


def run_in_blocks(
    shards: Sequence[Shard],
    rule: Rule,
    *,
    parts: Path,
    workers: int,
    scheduler: str,
) -> list[ShardResult]:
    """Run blocks of all shards until the planned starts, each method as long as it has to.

    Args:
        shards: One per method and perturbation, each of all starts.
        rule: Says who is out.
        parts: Folder for what blocks leave until they are put together; of the same storage.
        workers: Local processes.
        scheduler: `local` or the address of a Dask scheduler.

    Returns:
        One result per shard, of the starts that it ran.
    """
    names = dict.fromkeys(shard.judged.name for shard in shards)
    candidates = [name for name in names if name not in rule.simple]
    done: list[list[tuple[Part, ShardResult]]] = [[] for _ in shards]
    left, first = set(names), 0
    for end in rule.ends:
        running = [n for n, shard in enumerate(shards) if shard.judged.name in left]
        asked = [_part(shards[n], first, end, parts / f"{n}_{end}") for n in running]
        results = map_shards(run_part, asked, workers=workers, scheduler=scheduler)
        for n, part, result in zip(running, asked, results, strict=True):
            done[n].append((part, result))
        first = end
        seen = seen_of((row for own in done for _, r in own for row in r.rollouts), rule)
        left -= {name for name in candidates if name in left and first_out(rule, seen, name)}
        if candidates and not left & set(candidates):
            break
    wholes = [
        Whole(shard, tuple(part for part, _ in own), tuple(result for _, result in own))
        for shard, own in zip(shards, done, strict=True)
    ]
    return map_shards(put_together, wholes, workers=workers, scheduler=scheduler)


def _part(shard: Shard, first: int, end: int, place: Path) -> Part:
    own = replace(shard, first=first, end=end, journal=place.with_suffix(".mcap"))
    return Part(own, place.with_suffix(".parquet"))


def run_part(part: Part) -> ShardResult:
    """A block of a shard; its refused candidates wait in their file.

    Only all rollouts of a shard say which of them are worth a look.
    """
    result = run_shard(part.shard, every=True)
    write_rows(part.refused, RefusedRow, result.refused)
    return replace(result, refused=[])


def put_together(whole: Whole) -> ShardResult:
    """One journal and one result of the blocks of a shard; what they left is removed."""
    results = whole.results
    sessions = [
        _session(name, events)
        for part in whole.parts
        for name, events in read_journal(part.shard.journal).items()
    ]
    write_journal(whole.shard.journal, sessions)
    rollouts = [row for result in results for row in result.rollouts]
    kept = {row.start for row, whole in zip(rollouts, kept_whole(rollouts), strict=True) if whole}
    refused = [
        row
        for part in whole.parts
        for row in read_rows(part.refused, RefusedRow)
        if row.start in kept
    ]
    for part in whole.parts:
        part.shard.journal.unlink()
        part.refused.unlink()
    key = {"method": whole.shard.judged.name, "perturbation": whole.shard.perturbation}
    return ShardResult(
        rollouts=rollouts,
        invocations=[row for result in results for row in result.invocations],
        splices=[row for result in results for row in result.splices],
        recoveries=[row for result in results for row in result.recoveries],
        overruns=_overruns(results, key),
        faults=_faults(results, key),
        refused=refused,
        accounts=[account for result in results for account in result.accounts],
        ages_s=np.concatenate([result.ages_s for result in results]),
        stub=StressStubRow(
            **key,
            arrivals=sum(result.stub.arrivals for result in results),
            stale=sum(result.stub.stale for result in results),
            invalid=sum(result.stub.invalid for result in results),
        ),
        again=[row for result in results for row in result.again],
    )


def _session(name: str, events: Sequence[Event]) -> Journal:
    """A session as it was written, to be written again with the same bytes."""
    journal = Journal(name)
    for event in events:
        journal.add(event.kind, event.t, event.payload)
    return journal


def _overruns(results: Sequence[ShardResult], key: Mapping[str, str]) -> list[OverrunRow]:
    done: Counter[tuple[str, str]] = Counter()
    for result in results:
        done.update({(row.term, row.action): row.count for row in result.overruns if row.count})
    found = sorted(done.items()) or [(("", ""), 0)]
    return [OverrunRow(**key, term=of[0], action=of[1], count=count) for of, count in found]


def _faults(results: Sequence[ShardResult], key: Mapping[str, str]) -> list[FaultRow]:
    found: Counter[str] = Counter()
    for result in results:
        found.update({row.fault: row.count for row in result.faults if row.count})
    rows = sorted(found.items()) or [("", 0)]
    return [FaultRow(**key, fault=fault, count=count) for fault, count in rows]
