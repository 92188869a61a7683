"""One shadow session: a judged chunk through executor and stub, on the clock of its observation."""

from collections.abc import Sequence
from dataclasses import dataclass

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow.case import Case
from genpolicy.evidence.shadow.observations import Observation
from genpolicy.execution.cell import Cell
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal
from genpolicy.execution.ledger import Account
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import Supervisor
from genpolicy.feasibility.admission import Admitted, Rejected
from genpolicy.feasibility.settings import LAYERS

IN_FLIGHT_PHASE_CHANGE = "phase_change_in_flight"

Judged = tuple[Case, Admitted | Rejected]


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
    cell: Cell, item: Observation, judged: Sequence[Judged], *, fixture: str, number: int
) -> Played:
    """One session: deliver the first admitted candidate, tick until its horizon has passed.

    Args:
        cell: Executor, supervisor and stub.
        item: The observation.
        judged: Its candidates with their verdicts, in order.
        fixture: Name of what is tested.
        number: Number of the observation.
    """
    horizons = cell.horizons
    metadata = judged[0][0].proposal.metadata
    journal = Journal(
        f"{metadata.method}/{fixture}/{number}",
        {"method": metadata.method, "fixture": fixture, "situation": item.episode_uuid},
    )
    supervisor = Supervisor(cell.execution, journal)
    stub = ControllerStub(cell, journal, supervisor)
    executor = Executor(cell, journal, stub)
    active = judged[0][0].context
    executor.set_active(0.0, active.active_checkpoint_hash, active.active_sampler_hash)
    executor.observe(0.0, 0.0, item.phase, item.calibration_epoch)
    journal.scene(0.0, judged[0][0].poses)
    executor.begin_invocation(0.0, metadata.chunk_id)
    period_s, now_s = horizons.action_period_s, active.now_s
    executor.observe(now_s, now_s, item.phase, item.calibration_epoch)
    executor.end_invocation(now_s, metadata.chunk_id, "answered")
    delivered = _deliver(executor, journal, judged, now_s=now_s)
    first = round(now_s / period_s)
    for tick in range(first, first + horizons.execution_horizon + 1):
        phase = item.phase
        if fixture == IN_FLIGHT_PHASE_CHANGE and tick >= first + 2:
            phase = f"after {item.phase}"
        if tick > first:
            executor.observe(tick * period_s, tick * period_s, phase, item.calibration_epoch)
        executor.tick(tick * period_s)
    balance = executor.end_episode((first + horizons.execution_horizon + 1) * period_s)
    return Played(
        journal=journal,
        account=balance.chunks,
        delivered=delivered,
        arrivals=stub.arrivals,
        stale=stub.stale,
        invalid=stub.invalid,
    )


def _deliver(
    executor: Executor,
    journal: Journal,
    judged: Sequence[Judged],
    *,
    now_s: float,
) -> int:
    """Hand over the first admitted candidate; write the others off. Returns 1 if one was."""
    delivered = 0
    for case, result in judged:
        metadata, verdict = case.proposal.metadata, result.verdict
        journal.candidate(
            now_s,
            chunk_id=metadata.chunk_id,
            method=metadata.method,
            index=metadata.candidate_index,
            layers={layer.name: layer.passed for layer in verdict.layers},
            first_reason=verdict.first_reason or None,
        )
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
        return DiscardReason(result.verdict.first_reason)
    return DiscardReason.INFEASIBLE
