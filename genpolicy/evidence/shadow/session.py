"""One shadow session: a judged chunk through executor and stub, on the clock of its observation."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from genpolicy.contract.chunk import ChunkMetadata, DiscardReason
from genpolicy.evidence.shadow.case import Case
from genpolicy.evidence.shadow.observations import Observation
from genpolicy.evidence.shadow.on_the_way import Incident, Way
from genpolicy.execution.cell import Cell
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal
from genpolicy.execution.ledger import Account, Conservation
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import Supervisor
from genpolicy.feasibility.admission import Admitted, Rejected
from genpolicy.feasibility.freshness import REASONS
from genpolicy.feasibility.settings import LAYERS

ROUNDING_S = 1e-9
IN_FLIGHT_PHASE_CHANGE = "phase_change_in_flight"

Judged = tuple[Case, Admitted | Rejected]
Measures = Sequence[Mapping[str, Any]]
"""What a table states of each candidate beside its verdict; written beside it in the journal."""


@dataclass(frozen=True)
class Played:
    """What a session left.

    Attributes:
        journal: Its journal.
        account: Its balance of chunks.
        delivered: Chunks handed to the executor.
        arrivals: Actions that reached the stub.
        stale: Of these, older than allowed.
        invalid: Of these, not of a chunk that passed.
    """

    journal: Journal
    account: Account
    delivered: int
    arrivals: int
    stale: int
    invalid: int


def play(
    cell: Cell,
    item: Observation,
    judged: Sequence[Judged],
    *,
    fixture: str,
    number: int,
    measures: Measures = (),
) -> Played:
    """One session: deliver the first admitted candidate, tick until its horizon has passed.

    Args:
        cell: Executor, supervisor and stub.
        item: The observation.
        judged: Its candidates with their verdicts, in order.
        fixture: Name of what is tested.
        number: Number of the observation.
        measures: What a table states of each candidate, if anything.
    """
    now_s = judged[0][0].context.now_s
    executor, stub, journal = _begin(cell, item, judged[0][0], fixture, number)
    _answer(executor, item, judged[0][0], now_s)
    _note(journal, judged, measures, now_s=now_s)
    delivered = _deliver(executor, judged, now_s=now_s)
    leaves = item.phase if fixture != IN_FLIGHT_PHASE_CHANGE else f"after {item.phase}"
    balance = _tick(cell, executor, item, now_s, after=leaves)
    return _played(journal, stub, balance, delivered)


def play_incident(
    cell: Cell,
    item: Observation,
    case: Case,
    admitted: Admitted,
    incident: Incident,
    *,
    number: int,
    newer: Admitted | None = None,
) -> Played:
    """One session in which something happens while an admitted chunk is on its way.

    Args:
        cell: Executor, supervisor and stub.
        item: The observation.
        case: The chunk, and what it was made from.
        admitted: The chunk, admitted.
        incident: What happens.
        number: Number of the observation.
        newer: A chunk from an observation one period later, which arrives first; for an incident
            in which one is overtaken.
    """
    assert incident.overtaken == (newer is not None), "a newer chunk, exactly where one is named"
    metadata, context = case.proposal.metadata, case.context
    executor, stub, journal = _begin(cell, item, case, incident.name, number)
    ended_s = max(metadata.valid_until_s, context.maximum_age_s)
    late_s = ended_s + cell.horizons.action_period_s
    now_s = late_s if incident.late else context.now_s
    if newer is not None:
        now_s += cell.horizons.action_period_s
    _answer(executor, item, case, now_s)
    incident.happen(Way(
        executor, stub.supervisor, journal, item, case.poses, context.active_checkpoint_hash,
        context.active_sampler_hash, now_s,
    ))  # fmt: skip
    first = [] if newer is None else [newer]
    arrivals = [
        executor.deliver(chunk, now_s + incident.clock_s)
        for chunk in [*first, *[admitted] * incident.arrives]
    ]
    hanging = _Hanging(executor, metadata, len(case.proposal.actions)) if incident.hangs else None
    balance = _tick(
        cell, executor, item, now_s, after=item.phase, clock_s=incident.clock_s, hanging=hanging
    )
    return _played(journal, stub, balance, arrivals.count(None))


def _answer(executor: Executor, item: Observation, case: Case, now_s: float) -> None:
    """An invocation on the observation at time 0, which answers now, while another one comes."""
    invocation = case.proposal.metadata.chunk_id
    executor.begin_invocation(0.0, invocation)
    executor.observe(now_s, now_s, item.phase, item.calibration_epoch, tcp_m=case.seen_m)
    executor.end_invocation(now_s, invocation, "answered")


class _Hanging:
    """A policy that is asked for the next chunk, and never answers.

    When its deadline has passed it is given up, and what never came is accounted for as soon as
    the executor asks for another one.

    Args:
        executor: Asks.
        before: Metadata of the chunk before.
        rows: Actions of a chunk.
    """

    def __init__(self, executor: Executor, before: ChunkMetadata, rows: int) -> None:
        self._executor, self._rows = executor, rows
        self._asked_for = replace(before, chunk_id=f"{before.chunk_id}/next")
        self._given_up_s: float | None = None
        self._over = False

    def look(self, now_s: float) -> None:
        """Time goes by."""
        executor, name = self._executor, self._asked_for.chunk_id
        if self._given_up_s is None:
            if executor.needs_invocation(now_s):
                executor.begin_invocation(now_s, name)
                self._given_up_s = now_s + executor.cell.execution.deadline_s
        elif now_s >= self._given_up_s - ROUNDING_S and not self._over:
            executor.end_invocation(now_s, name, "deadline")
            self._over = executor.needs_invocation(now_s)
            if self._over:
                executor.write_off(self._asked_for, self._rows, DiscardReason.EXPIRED, now_s)


def _tick(
    cell: Cell,
    executor: Executor,
    item: Observation,
    now_s: float,
    *,
    after: str,
    clock_s: float = 0.0,
    hanging: _Hanging | None = None,
) -> Conservation:
    """Tick until the horizon has passed; from the third tick on the phase is `after`.

    Where a policy hangs, until the deadline of an invocation at the end of the horizon has, too.
    """
    period_s, ticks = cell.horizons.action_period_s, cell.horizons.execution_horizon + 1
    if hanging is not None:
        ticks += math.ceil(cell.execution.deadline_s / period_s) + 1
    first = round(now_s / period_s)
    for tick in range(first, first + ticks):
        told_s = tick * period_s + clock_s
        if tick > first:
            phase = item.phase if tick < first + 2 else after
            executor.observe(told_s, told_s, phase, item.calibration_epoch)
        if hanging is not None:
            hanging.look(told_s)
        executor.tick(told_s)
    return executor.end_episode((first + ticks) * period_s + clock_s)


def _played(
    journal: Journal, stub: ControllerStub, balance: Conservation, delivered: int
) -> Played:
    return Played(
        journal=journal,
        account=balance.chunks,
        delivered=delivered,
        arrivals=stub.arrivals,
        stale=stub.stale,
        invalid=stub.invalid,
    )


def note_only(
    cell: Cell,
    item: Observation,
    judged: Sequence[Judged],
    *,
    fixture: str,
    number: int,
    measures: Measures = (),
) -> Journal:
    """A session in which candidates are judged and nothing is asked for, delivered or executed.

    Its arguments are those of `play`.
    """
    executor, _, journal = _begin(cell, item, judged[0][0], fixture, number)
    now_s = judged[0][0].context.now_s
    _note(journal, judged, measures, now_s=now_s)
    executor.end_episode(now_s)
    return journal


def _begin(
    cell: Cell, item: Observation, case: Case, fixture: str, number: int
) -> tuple[Executor, ControllerStub, Journal]:
    """A session in which the observation was made at time 0."""
    method = case.proposal.metadata.method
    labels = {
        "method": method, "fixture": fixture, "situation": f"{item.episode_uuid}:{item.index}",
        "observation": str(number),
    }  # fmt: skip
    journal = Journal(f"{method}/{fixture}/{number}", labels)
    supervisor = Supervisor(cell.execution, journal)
    stub = ControllerStub(cell, journal, supervisor)
    executor = Executor(cell, journal, stub)
    active = case.context
    executor.set_active(0.0, active.active_checkpoint_hash, active.active_sampler_hash)
    executor.controller(0.0, cell.controller_mode)
    executor.observe(0.0, 0.0, item.phase, item.calibration_epoch, tcp_m=case.seen_m)
    executor.see(0.0, case.poses)
    return executor, stub, journal


def _note(journal: Journal, judged: Sequence[Judged], measures: Measures, *, now_s: float) -> None:
    """The verdict on each candidate, with what a table states of it."""
    for number, (case, result) in enumerate(judged):
        metadata, verdict = case.proposal.metadata, result.verdict
        journal.candidate(
            now_s,
            chunk_id=metadata.chunk_id,
            method=metadata.method,
            index=metadata.candidate_index,
            layers={layer.name: layer.passed for layer in verdict.layers},
            first_reason=verdict.first_reason or None,
            measures=measures[number] if measures else None,
        )


def _deliver(executor: Executor, judged: Sequence[Judged], *, now_s: float) -> int:
    """Hand over the first admitted candidate; write the others off. Returns 1 if one was."""
    delivered = 0
    for case, result in judged:
        metadata = case.proposal.metadata
        if isinstance(result, Admitted) and not delivered:
            delivered += executor.deliver(result, now_s) is None
        else:
            executor.write_off(metadata, len(case.proposal.actions), _reason(result), now_s)
    return delivered


def _reason(result: Admitted | Rejected) -> DiscardReason:
    """Why a chunk is not delivered: another was, it is not fresh, or a layer rejected it."""
    if isinstance(result, Admitted):
        return DiscardReason.SUPERSEDED
    if result.verdict.first_layer == LAYERS[-1]:
        return REASONS[result.reason]
    return DiscardReason.INFEASIBLE
