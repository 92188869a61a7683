"""Shadow evidence: candidates on held-out and corrupted observations, down to the stub.

Nothing moves: each chunk that passes runs through executor and controller stub on the recorded
clock of its observation, and the journal of that is what the independent checker reads.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.selector import propose
from genpolicy.contract.action import POSITION
from genpolicy.contract.chunk import Candidate, ChunkMetadata
from genpolicy.evidence.admission_context import Moment, Session, context_of
from genpolicy.evidence.shadow.candidate_rows import RowLabels, candidate_row, measures_of
from genpolicy.evidence.shadow.case import Case, decide, newer_than
from genpolicy.evidence.shadow.corruption import CORRUPTIONS
from genpolicy.evidence.shadow.found import ShadowEvidence
from genpolicy.evidence.shadow.observations import Observation
from genpolicy.evidence.shadow.on_the_way import INCIDENTS, Incident
from genpolicy.evidence.shadow.session import (
    IN_FLIGHT_PHASE_CHANGE,
    Judged,
    note_only,
    play,
    play_incident,
)
from genpolicy.execution.cell import Cell
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected
from genpolicy.policies.protocol import Policy
from genpolicy.tasks.api import Task

Array = NDArray[np.float64]

HELD_OUT = "held_out"
TWO_MODES = "two_modes"
DEMONSTRATION = "demonstration"
# Observations of a phase: of fixtures without anything of the candidate's chunk, of incidents.
BUILT_EVERY = 6


class Identity(Protocol):
    """Whose chunk it is."""

    @property
    def method(self) -> str:
        """Name of the method."""
        ...

    @property
    def checkpoint_hash(self) -> str:
        """Its weights."""
        ...

    @property
    def sampler_config_hash(self) -> str:
        """Its sampler settings."""
        ...


@dataclass(frozen=True)
class Demonstrated:
    """Identity of what the operator did."""

    method: str = DEMONSTRATION
    checkpoint_hash: str = DEMONSTRATION
    sampler_config_hash: str = DEMONSTRATION


@dataclass(frozen=True)
class Shadow:
    """What every shadow test shares.

    Attributes:
        task: The task.
        checker: The six layers.
        cell: Executor, supervisor and stub.
        late_rows: Actions that are late when a chunk arrives.
        samples: Candidates per observation.
    """

    task: Task
    checker: FeasibilityChecker
    cell: Cell
    late_rows: int
    samples: int

    def __post_init__(self) -> None:
        self.cell.require_task(self.task.phases)
        self.checker.cell.require_within(self.cell.execution.force_limit_n)


def shadow_policy(
    shadow: Shadow,
    policy: Policy,
    observations: list[Observation],
    *,
    seed: int,
    two_mode: Sequence[Observation] = (),
) -> ShadowEvidence:
    """Every candidate of a policy on every observation, intact and corrupted.

    Args:
        shadow: What every shadow test shares.
        policy: The policy.
        observations: Held-out moments.
        seed: Number of its training seed.
        two_mode: Moments at which modes were found: judged and journaled, neither corrupted nor
            executed.
    """
    evidence = ShadowEvidence()
    of_phase: Counter[str] = Counter()
    good_of_phase: Counter[str] = Counter()
    for number, (item, cases) in enumerate(_answers(shadow, policy, [*observations, *two_mode])):
        seen = _Seen(shadow, evidence, item, number, seed)
        if number >= len(observations):
            seen.note(seen.judge(cases, fixture=TWO_MODES), fixture=TWO_MODES)
            continue
        judged = seen.judge(cases, fixture=HELD_OUT)
        seen.play(judged, fixture=HELD_OUT)
        if any(isinstance(result, Admitted) for _, result in judged.pairs):
            seen.play(judged, fixture=IN_FLIGHT_PHASE_CHANGE)
            for incident in INCIDENTS if good_of_phase[item.phase] % BUILT_EVERY == 0 else ():
                seen.play_incident(judged, incident)
            good_of_phase[item.phase] += 1
        skip_built = of_phase[item.phase] % BUILT_EVERY > 0
        of_phase[item.phase] += 1
        for corruption in CORRUPTIONS:
            if corruption.built and skip_built:
                continue
            broken = corruption.apply(cases[0], shadow.checker)
            if broken is not None:
                seen.play(seen.judge([broken], fixture=corruption.name), fixture=corruption.name)
    return evidence


def _answers(
    shadow: Shadow, policy: Policy, observations: Sequence[Observation]
) -> Iterator[tuple[Observation, list[Case]]]:
    """The candidates of a policy at each observation."""
    drawn = policy.sample(
        np.stack([item.history for item in observations]),
        noise_names=[("shadow", item.episode_uuid, item.index) for item in observations],
        candidates=shadow.samples,
    )
    for number, (item, chunks) in enumerate(zip(observations, drawn.actions, strict=True)):
        yield (
            item,
            [
                case_of(shadow, item, chunk, number=number, candidate=k, of=policy)
                for k, chunk in enumerate(chunks)
            ],
        )


@dataclass(frozen=True)
class _Judgement:
    """Candidates with their verdicts, and what the table states of each."""

    pairs: list[Judged]
    measures: list[dict[str, Any]]


@dataclass(frozen=True)
class _Seen:
    """One observation under test, and where its evidence goes."""

    shadow: Shadow
    evidence: ShadowEvidence
    item: Observation
    number: int
    seed: int

    def judge(self, cases: list[Case], *, fixture: str) -> _Judgement:
        """Judge chunks; every verdict is a row."""
        judged = [(case, admit(self.shadow, case)) for case in cases]
        labels = RowLabels(self.seed, fixture, self.item, self.number)
        rows = [
            candidate_row(
                self.shadow.checker, self.shadow.task, labels, case, result, candidate=number
            )
            for number, (case, result) in enumerate(judged)
        ]
        self.evidence.candidates.extend(rows)
        return _Judgement(judged, [measures_of(row) for row in rows])

    def note(self, judged: _Judgement, *, fixture: str) -> None:
        """Journal them without a session."""
        self.evidence.sessions.append(
            note_only(
                self.shadow.cell, self.item, judged.pairs, fixture=fixture, number=self.number,
                measures=judged.measures,
            )
        )  # fmt: skip

    def play(self, judged: _Judgement, *, fixture: str) -> None:
        """Run a session with them."""
        played = play(
            self.shadow.cell, self.item, judged.pairs, fixture=fixture, number=self.number,
            measures=judged.measures,
        )  # fmt: skip
        self.evidence.keep(played, judged.pairs[0][0].proposal.metadata.method, fixture)

    def play_incident(self, judged: _Judgement, incident: Incident) -> None:
        """Run a session in which something happens to the first admitted candidate, if any."""
        for case, result in judged.pairs:
            if isinstance(result, Admitted):
                newer = newer_than(self.shadow.checker, case) if incident.overtaken else None
                played = play_incident(
                    self.shadow.cell, self.item, case, result, incident, number=self.number,
                    newer=newer,
                )  # fmt: skip
                self.evidence.keep(played, case.proposal.metadata.method, incident.name)
                return


def case_of(
    shadow: Shadow,
    item: Observation,
    actions: Array,
    *,
    number: int,
    candidate: int = 0,
    of: Identity | None = None,
) -> Case:
    """A chunk of an observation at time 0, arriving `late_rows` later.

    Args:
        shadow: What every shadow test shares.
        item: The observation.
        actions: The chunk. Shape (K, 10).
        number: Number of the observation.
        candidate: Number of the candidate.
        of: Whose chunk it is; None: the operator's.
    """
    source = of or Demonstrated()
    horizons = shadow.cell.horizons
    period_s = horizons.action_period_s
    metadata = ChunkMetadata(
        chunk_id=f"{number}/{candidate}",
        condition_observation_event_time_s=0.0,
        policy_checkpoint_hash=source.checkpoint_hash,
        sampler_config_hash=source.sampler_config_hash,
        action_start_time_s=0.0,
        action_period_s=period_s,
        valid_until_s=horizons.execution_horizon * period_s,
        task_phase=item.phase,
        calibration_epoch=item.calibration_epoch,
        predecessor_chunk_id="",
        session_epoch=0,
        method=source.method,
        candidate_index=candidate,
    )
    observation, task = item.history[-1], shadow.task
    q, _ = shadow.checker.ik_chunk(task.action_at(observation)[None], task.posture_rad)
    session = Session(
        calibration_epoch=item.calibration_epoch,
        session_epoch=0,
        checkpoint=source.checkpoint_hash,
        sampler=source.sampler_config_hash,
        maximum_age_s=shadow.cell.execution.maximum_age_s,
        controller_mode=shadow.cell.controller_mode,
    )
    now_s = shadow.late_rows * period_s
    moment = Moment(
        observation, q[0], list(item.commanded), now_s=now_s, phase=item.phase,
        q_before=_joints_before(shadow, item, q[0]), measured_at_s=0.0,
    )  # fmt: skip
    context = context_of(task, shadow.checker, moment, session=session, late_rows=shadow.late_rows)
    proposal = propose([Candidate(metadata, actions)])
    return Case(
        proposal, context, task.scene_poses(observation), task.obstacles, task.free_phases,
        tcp_m=task.action_at(observation)[POSITION],
    )  # fmt: skip


def _joints_before(shadow: Shadow, item: Observation, q_rad: Array) -> Array | None:
    """Joint positions (J,), rad, one observation before; None where there is none."""
    if len(item.history) < 2:
        return None
    before, reached = shadow.checker.ik_chunk(shadow.task.action_at(item.history[-2])[None], q_rad)
    return before[0] if reached[0] else None


def admit(shadow: Shadow, case: Case) -> Admitted | Rejected:
    """The verdict of the six layers."""
    return decide(shadow.checker, case)
