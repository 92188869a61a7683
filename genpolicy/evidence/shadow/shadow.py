"""Shadow evidence: candidates on held-out and corrupted observations, down to the stub.

Nothing moves: each chunk that passes runs through executor and controller stub on the recorded
clock of its observation, and the journal of that is what the independent checker reads.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION
from genpolicy.contract.chunk import ChunkMetadata, DiscardReason, Proposal
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset
from genpolicy.evidence.admission_context import COMMANDS_AT_THE_SEAM, Session, context_of
from genpolicy.evidence.shadow.corruption import CORRUPTIONS, Case, Corruption
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal
from genpolicy.execution.ledger import Account
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import Supervisor
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected
from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import Verdict
from genpolicy.policies.policy import Policy
from genpolicy.tasks.api import Task

Array = NDArray[np.float64]

HELD_OUT = "held_out"
SELECTOR = "first_admissible"
IN_FLIGHT_PHASE_CHANGE = "phase_change_in_flight"


@dataclass(frozen=True)
class Observation:
    """One held-out moment.

    Attributes:
        episode_uuid: Its episode.
        index: Its row there.
        phase: Its task phase.
        calibration_epoch: Its calibration.
        history: The last H_o observations. Shape (H_o, D_o).
        commanded: The last commands up to the observation. Shape (n, 10).
        demonstrated: What the operator did next. Shape (K, 10).
    """

    episode_uuid: str
    index: int
    phase: str
    calibration_epoch: str
    history: Array
    commanded: Array
    demonstrated: Array


@dataclass
class ShadowEvidence:
    """Rows of the tables, sessions of the journal."""

    candidates: list[dict[str, Any]] = field(default_factory=list)
    stub: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    accounts: dict[tuple[str, str], list[Account]] = field(default_factory=dict)
    sessions: list[Journal] = field(default_factory=list)


@dataclass(frozen=True)
class Shadow:
    """What every shadow test shares.

    Attributes:
        task: The task.
        checker: The six layers.
        horizons: H_o, K, H_e and the period.
        execution: Fixtures of the executor.
        late_steps: Actions that are late when a chunk arrives.
        candidates: Candidates per observation.
    """

    task: Task
    checker: FeasibilityChecker
    horizons: HorizonConfig
    execution: ExecutionSettings
    late_steps: int
    candidates: int


def held_out_observations(
    data: Dataset, *, horizons: HorizonConfig, count: int, generator: np.random.Generator
) -> list[Observation]:
    """Held-out rows of successful episodes, drawn in equal numbers from every phase."""
    cut = data.windows(
        "test",
        observation_horizon=horizons.observation_horizon,
        prediction_horizon=horizons.prediction_horizon,
    )
    lengths = data.episodes["rows"].to_numpy(dtype=np.int64)
    first = (np.cumsum(lengths) - lengths)[cut.episode]
    rows = first + cut.index
    phases = data.frames.phase[rows]
    names = sorted(set(phases.tolist()))
    chosen: list[int] = []
    for name in names:
        of_phase = np.flatnonzero(phases == name)
        size = min(len(of_phase), count // len(names))
        chosen += sorted(generator.choice(of_phase, size=size, replace=False).tolist())
    result = []
    for window in chosen:
        row, begin = int(rows[window]), int(first[window])
        back = np.arange(row - COMMANDS_AT_THE_SEAM + 1, row + 1)
        episode = data.episodes.iloc[int(cut.episode[window])]
        result.append(
            Observation(
                episode_uuid=str(episode["episode_uuid"]),
                index=int(cut.index[window]),
                phase=str(phases[window]),
                calibration_epoch=str(episode["calibration_epoch"]),
                history=cut.observations[window],
                commanded=data.frames.action[np.maximum(back, begin)],
                demonstrated=cut.actions[window],
            )
        )
    return result


def shadow_policy(
    shadow: Shadow, policy: Policy, observations: list[Observation], *, seed: int
) -> ShadowEvidence:
    """Every candidate of a policy on every observation, intact and corrupted."""
    evidence = ShadowEvidence()
    names = [("shadow", item.episode_uuid, item.index) for item in observations]
    drawn = policy.sample(
        np.stack([item.history for item in observations]),
        noise_names=names,
        candidates=shadow.candidates,
    )
    for number, (item, chunks) in enumerate(zip(observations, drawn.actions, strict=True)):
        cases = [_case(shadow, policy, item, number, k, chunk) for k, chunk in enumerate(chunks)]
        verdicts = [_admit(shadow, case) for case in cases]
        for candidate, (case, result) in enumerate(zip(cases, verdicts, strict=True)):
            row = _row(shadow, item, case, result, fixture=HELD_OUT)
            evidence.candidates.append(
                {**row, "seed": seed, "observation": number, "candidate": candidate}
            )
        _play(shadow, evidence, item, cases, verdicts, fixture=HELD_OUT, number=number)
        if any(isinstance(result, Admitted) for result in verdicts):
            _play(
                shadow,
                evidence,
                item,
                cases,
                verdicts,
                fixture=IN_FLIGHT_PHASE_CHANGE,
                number=number,
            )
        for corruption in CORRUPTIONS:
            _corrupted(shadow, evidence, item, cases[0], corruption, seed=seed, number=number)
    return evidence


def missing_checks_evidence(
    shadow: Shadow,
    observations: list[Observation],
    *,
    without: Mapping[tuple[str, ...], FeasibilityChecker],
) -> list[dict[str, Any]]:
    """For each check: is a corrupted demonstration refused with it, and admitted without it?

    Args:
        shadow: The shadow test, with all checks.
        observations: Held-out moments; what the operator did is the good chunk.
        without: A checker for each group of checks, made without them.

    Returns:
        Rows of `mutants.json`: check, layer, detected, and how many cases showed it.
    """
    rows = []
    for corruption in CORRUPTIONS:
        if not corruption.checks:
            continue
        mutant = replace(shadow, checker=without[corruption.checks])
        tried = noticed = 0
        for number, item in enumerate(observations):
            good = _case(shadow, None, item, number, 0, item.demonstrated)
            bad = corruption.apply(good, shadow.checker)
            if bad is None or not isinstance(_admit(shadow, good), Admitted):
                continue
            tried += 1
            refused = isinstance(_admit(shadow, bad), Rejected)
            noticed += refused and isinstance(_admit(mutant, bad), Admitted)
        rows.append(
            {
                "check": "+".join(corruption.checks),
                "fixture": corruption.name,
                "layer": corruption.layer,
                "detected": noticed > 0,
                "violations": noticed,
                "tried": tried,
            }
        )
    return rows


def _case(  # noqa: PLR0917
    shadow: Shadow,
    policy: Policy | None,
    item: Observation,
    number: int,
    candidate: int,
    actions: Array,
) -> Case:
    """A chunk of an observation at time 0, arriving `late_steps` later."""
    period_s, horizon = shadow.horizons.action_period_s, shadow.horizons.execution_horizon
    now_s = shadow.late_steps * period_s
    checkpoint = policy.checkpoint_hash if policy is not None else "demonstration"
    sampler = policy.sampler_config_hash if policy is not None else "demonstration"
    metadata = ChunkMetadata(
        chunk_id=f"{number}/{candidate}",
        condition_observation_event_time_s=0.0,
        policy_checkpoint_hash=checkpoint,
        sampler_config_hash=sampler,
        action_start_time_s=0.0,
        action_period_s=period_s,
        valid_until_s=horizon * period_s,
        task_phase=item.phase,
        calibration_epoch=item.calibration_epoch,
        predecessor_chunk_id="",
        session_epoch=0,
        method=policy.method if policy is not None else "demonstration",
        candidate_index=candidate,
    )
    observation = item.history[-1]
    q, _ = shadow.checker.ik_chunk(
        shadow.task.action_at(observation)[None], shadow.task.posture_rad
    )
    context = context_of(
        shadow.task,
        shadow.checker,
        observation=observation,
        q_meas=q[0],
        commanded=list(item.commanded),
        now_s=now_s,
        phase=item.phase,
        latest_observation_s=now_s,
        session=Session(
            item.calibration_epoch, 0, checkpoint, sampler, shadow.execution.maximum_age_s
        ),
        first_index=shadow.late_steps,
        end_index=horizon,
    )
    return Case(
        Proposal(metadata, actions, selected_by=SELECTOR),
        context,
        shadow.task.scene_poses(observation),
        shadow.task.obstacles,
        shadow.task.free_phases,
    )


def _admit(shadow: Shadow, case: Case) -> Admitted | Rejected:
    return shadow.checker.admit(case.proposal, context=case.context)


def _row(
    shadow: Shadow, item: Observation, case: Case, result: Admitted | Rejected, *, fixture: str
) -> dict[str, Any]:
    """One row of `candidates.parquet`."""
    verdict: Verdict = result.verdict
    projected = result.projected
    failed = [layer for layer in verdict.layers if layer.passed is False]
    raw = case.proposal.actions
    observation = item.history[-1]
    finite = bool(np.all(np.isfinite(raw)))
    mode = shadow.task.mode_of(raw[:, POSITION], observation) if finite else "none"
    return {
        "method": case.proposal.metadata.method,
        "fixture": fixture,
        "situation": f"{item.episode_uuid}:{item.index}",
        "phase": item.phase,
        "mode": mode,
        **{layer.name: layer.passed for layer in verdict.layers},
        "first_reason": verdict.first_reason,
        "layer_margin": _finite(failed[0].margin) if failed else _smallest(verdict),
        "position_change_m": _finite(projected.position_change_m),
        "rotation_change_rad": _finite(projected.rotation_change_rad),
        "boundary_jerk_m_s3": _finite(
            shadow.checker.boundary_jerk_m_s3(projected, context=case.context)
        ),
        "raw": raw.ravel().tolist(),
        "projected": projected.actions.ravel().tolist(),
    }


def _corrupted(
    shadow: Shadow,
    evidence: ShadowEvidence,
    item: Observation,
    case: Case,
    corruption: Corruption,
    *,
    seed: int,
    number: int,
) -> None:
    broken = corruption.apply(case, shadow.checker)
    if broken is None:
        return
    result = _admit(shadow, broken)
    row = _row(shadow, item, broken, result, fixture=corruption.name)
    evidence.candidates.append({**row, "seed": seed, "observation": number, "candidate": 0})
    _play(shadow, evidence, item, [broken], [result], fixture=corruption.name, number=number)


def _play(
    shadow: Shadow,
    evidence: ShadowEvidence,
    item: Observation,
    cases: list[Case],
    results: list[Admitted | Rejected],
    *,
    fixture: str,
    number: int,
) -> None:
    """One session: deliver the first admitted candidate, tick until its horizon has passed."""
    metadata = cases[0].proposal.metadata
    journal = Journal(
        f"{metadata.method}/{fixture}/{number}",
        {"method": metadata.method, "fixture": fixture, "situation": item.episode_uuid},
    )
    settings = shadow.execution.executor(shadow.horizons)
    supervisor = Supervisor(shadow.execution.supervisor(shadow.horizons), journal)
    stub = ControllerStub(settings, journal, supervisor)
    executor = Executor(settings, journal, stub)
    active = cases[0].context
    executor.set_active(0.0, active.active_checkpoint_hash, active.active_sampler_hash)
    executor.observe(0.0, 0.0, item.phase, item.calibration_epoch)
    executor.begin_invocation(0.0, metadata.chunk_id)
    period_s, now_s = shadow.horizons.action_period_s, active.now_s
    executor.observe(now_s, now_s, item.phase, item.calibration_epoch)
    executor.end_invocation(now_s, metadata.chunk_id, "answered")
    delivered = _deliver(executor, journal, cases, results, now_s=now_s)
    first = round(now_s / period_s)
    for tick in range(first, first + shadow.horizons.execution_horizon + 1):
        phase = item.phase
        if fixture == IN_FLIGHT_PHASE_CHANGE and tick >= first + 2:
            phase = f"after {item.phase}"
        if tick > first:
            executor.observe(tick * period_s, tick * period_s, phase, item.calibration_epoch)
        executor.tick(tick * period_s)
    balance = executor.end_episode((first + shadow.horizons.execution_horizon + 1) * period_s)
    key = (metadata.method, fixture)
    evidence.stub[(*key, "arrivals")] += stub.arrivals
    evidence.stub[(*key, "stale")] += stub.stale
    evidence.stub[(*key, "invalid")] += stub.invalid
    evidence.stub[(*key, "delivered")] += delivered
    evidence.accounts.setdefault(key, []).append(balance.chunks)
    evidence.sessions.append(journal)


def _deliver(
    executor: Executor,
    journal: Journal,
    cases: list[Case],
    results: list[Admitted | Rejected],
    *,
    now_s: float,
) -> int:
    """Hand over the first admitted candidate; write the others off. Returns 1 if one was."""
    delivered = 0
    for case, result in zip(cases, results, strict=True):
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


def _smallest(verdict: Verdict) -> float | None:
    margins = [layer.margin for layer in verdict.layers if np.isfinite(layer.margin)]
    return float(min(margins)) if margins else None


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
