"""What rollouts share, and what one of them carries along."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.joining import REPLACE, JoiningSettings
from genpolicy.candidates.votes import Votes
from genpolicy.contract.chunk import ChunkMetadata
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.latency import Overrun, Term, overruns
from genpolicy.evidence.stress.latency import LatencyModel, draw_check, draw_latency
from genpolicy.evidence.stress.person import Attendance
from genpolicy.evidence.stress.perturbations import Perturbation, injection
from genpolicy.evidence.stress.settings import PersonSettings
from genpolicy.execution.attended import AttendedExecutor
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.journal import Journal
from genpolicy.execution.recovery import Recovery
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.tasks.api import NOMINAL_PROBE, Task, World

Array = NDArray[np.float64]


class Outcome(StrEnum):
    """How a rollout ended."""

    SUCCESS = "success"
    COLLISION = "collision"
    FORCE_STOP = "force_stop"
    INTERVENTION = "intervention"
    TIMEOUT = "timeout"
    ASSISTED = "assisted"
    """The task's success test held after a person was called: no success of the policy."""


@dataclass(frozen=True)
class Setup:
    """What all rollouts of one method under one perturbation share.

    Attributes:
        task: The task.
        checker: The six layers.
        horizons: H_o, K, H_e and the period.
        execution: Executor, supervisor and recovery.
        latency: Latency of the method.
        perturbation: Name of the perturbation.
        schedule: What it injects.
        root_seed: Root seed.
        method: Name of the method.
        checkpoint: Its weights.
        sampler: Its sampler settings, and the rule by which its chunks join.
        joining: That rule.
        person: Who comes when one is called; None: nobody.
        probe: Probe of the task that their worlds are under.
    """

    task: Task
    checker: FeasibilityChecker
    horizons: HorizonConfig
    execution: ExecutionSettings
    latency: LatencyModel
    perturbation: str
    schedule: Perturbation
    root_seed: int
    method: str
    checkpoint: str
    sampler: str
    joining: JoiningSettings = field(default_factory=JoiningSettings)
    person: PersonSettings | None = None
    probe: str = NOMINAL_PROBE

    def __post_init__(self) -> None:
        self.checker.cell.require_within(self.execution.force_limit_n)

    def attendance(
        self, world: World, executor: AttendedExecutor, recovery: Recovery, start: int
    ) -> Attendance:
        """The person of one rollout."""
        key = (self.root_seed, self.perturbation, start)
        return Attendance(self.person, self.task, world, executor, recovery, key)

    def journal(self, start: int, start_sha256: str) -> Journal:
        """The empty journal of one rollout."""
        labels = {
            "method": self.method, "perturbation": self.perturbation, "start": str(start),
            "start_sha256": start_sha256,
        }  # fmt: skip
        if self.joining.rule != REPLACE:
            labels["joining"] = self.joining.rule
        return Journal(f"{self.method}/{self.perturbation}/{start}", labels)


@dataclass
class InFlight:
    """An invocation that has not been delivered yet.

    Attributes:
        number: Count of invocations in this rollout.
        metadata: Of the chunk to come; candidate 0.
        observation: What it is conditioned on; the newest of the history. Shape (D_o,).
        exposed_s: When what it is conditioned on was exposed; all its times count from there.
        arrival_s: When its candidate is judged; later with each one that is refused.
        compute_factor: What compute contention multiplies its measured terms by.
        dropped: Lost on the way.
        terms_s: What each of the eleven terms takes, s, by name; the first check is one of them.
        chunks: Sampled candidates, filled in by the batch. Shape (N, K, D_a).
        candidate: The candidate that is judged next.
        given_up: Its deadline has passed.
        overran: Terms that take longer than they may and are not dealt with yet.
        draw: Which of the samples the candidate is.
        votes: Earlier predictions that have a say in the candidate, oldest first.
        prefix: Actions (K, D_a) that the samples go on from, and weights (K,); None: nothing.
        fault: How a policy in a process of its own failed it; empty where it did not.
    """

    number: int
    metadata: ChunkMetadata
    observation: Array
    exposed_s: float
    arrival_s: float
    compute_factor: float
    dropped: bool
    terms_s: Mapping[str, float]
    chunks: Array | None = None
    candidate: int = 0
    given_up: bool = False
    overran: list[Overrun] = field(default_factory=list)
    draw: int = 0
    votes: Sequence[Votes] = ()
    prefix: tuple[Array, Array] | None = None
    fault: str = ""

    @property
    def comes(self) -> bool:
        """Whether there is an answer that is on its way."""
        return not self.dropped and not self.fault

    @property
    def candidates(self) -> int:
        """Candidates that were drawn; none before the batch filled them in."""
        return 0 if self.chunks is None else len(self.chunks)

    @property
    def drawn(self) -> Array | None:
        """The sample that was proposed last, as drawn. Shape (K, D_a)."""
        return None if self.chunks is None else self.chunks[self.draw]

    @property
    def total_s(self) -> float:
        """Its end-to-end latency so far: the eleven terms, and every check after the first, s."""
        return self.arrival_s - self.exposed_s

    def tell(self, journal: Journal, now_s: float) -> None:
        """Put the terms of its latency on record."""
        terms = {f"{term}_s": float(self.terms_s[term]) for term in Term}
        journal.add("latency", journal.clock(now_s), {"id": self.metadata.chunk_id, **terms})


@dataclass
class Tally:
    """What a rollout counts while it runs."""

    mode: str = ""
    action_ticks: int = 0
    hold_ticks: int = 0
    fallback_ticks: int = 0
    deadline_misses: int = 0
    force_peak_n: float = 0.0
    rejected_by: dict[str, int] = field(default_factory=dict)
    refused: set[str] = field(default_factory=set)
    overruns: Counter[tuple[str, str]] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    latencies_s: list[float] = field(default_factory=list)
    path_m: list[Array] = field(default_factory=list)

    @property
    def rejections(self) -> int:
        """Invocations of which a candidate was refused and none passed."""
        return len(self.refused)

    def feel(self, journal: Journal, now_s: float, force_n: float) -> None:
        """Note a contact force; a new peak goes on record."""
        if force_n > self.force_peak_n:
            self.force_peak_n = float(force_n)
            journal.add("force", journal.clock(now_s), {"force_n": self.force_peak_n})

    def conclude(self, journal: Journal, task: Task, outcome: Outcome, observation: Array) -> None:
        """Put the outcome on record, before the session ends. Observation: the last, (D_o,)."""
        self.mode = task.mode_of(np.stack(self.path_m), observation)
        payload = {"outcome": str(outcome), "mode": self.mode}
        journal.add("outcome", journal.latest_ns, payload)


def in_flight(
    setup: Setup,
    metadata: ChunkMetadata,
    observation: Array,
    *,
    sensor_s: Mapping[str, float],
    start: int,
    number: int,
) -> InFlight:
    """An invocation that begins now: how long it takes, and what it suffers.

    Args:
        setup: What all rollouts share.
        metadata: Of the chunk to come; it starts where the observation was exposed.
        observation: What it is conditioned on. Shape (D_o,).
        sensor_s: What each sensor term of the observation took, by name, s.
        start: Index of the initial state; key of the draws.
        number: Count of invocations in this rollout; key of the draws.
    """
    hit = injection(
        setup.schedule,
        root_seed=setup.root_seed,
        name=setup.perturbation,
        start=start,
        invocation=number,
    )
    draw = draw_latency(
        setup.latency,
        root_seed=setup.root_seed,
        perturbation=setup.perturbation,
        start=start,
        invocation=number,
        extra_s=hit.extra_s,
        compute_factor=hit.compute_factor,
    )
    terms_s = {**draw.terms, **sensor_s}
    exposed_s = metadata.condition_observation_event_time_s
    return InFlight(
        number=number,
        metadata=metadata,
        observation=observation,
        exposed_s=exposed_s,
        arrival_s=exposed_s + sum(terms_s.values()),
        compute_factor=hit.compute_factor,
        dropped=hit.dropped,
        terms_s=terms_s,
        overran=list(overruns(terms_s, setup.execution.term_deadlines)),
    )


def next_candidate(setup: Setup, flying: InFlight, *, start: int) -> float:
    """Go on to the next candidate of an invocation; returns what its check takes, s."""
    flying.candidate += 1
    check_s = draw_check(
        setup.latency,
        root_seed=setup.root_seed,
        perturbation=setup.perturbation,
        start=start,
        invocation=flying.number,
        candidate=flying.candidate,
        compute_factor=flying.compute_factor,
    )
    flying.arrival_s += check_s
    project = setup.execution.term_deadlines.get(Term.PROJECT)
    if project is not None and not check_s <= project.most_s:
        known_s = flying.total_s - check_s + project.most_s
        flying.overran.append(Overrun(Term.PROJECT, project.action, known_s))
    return check_s
