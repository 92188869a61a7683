"""What rollouts share, and what one of them carries along."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import ChunkMetadata
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.evidence.stress.latency import LatencyModel
from genpolicy.evidence.stress.perturbations import Perturbation
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.tasks.api import Task

Array = NDArray[np.float64]


class Outcome(StrEnum):
    """How a rollout ended."""

    SUCCESS = "success"
    COLLISION = "collision"
    FORCE_STOP = "force_stop"
    INTERVENTION = "intervention"
    TIMEOUT = "timeout"


@dataclass(frozen=True)
class Fixture:
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
        sampler: Its sampler settings.
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


@dataclass
class InFlight:
    """An invocation that has not been delivered yet.

    Attributes:
        number: Count of invocations in this rollout.
        metadata: Of the chunk to come; candidate 0.
        observation: What it is conditioned on; the newest of the history. Shape (D_o,).
        begun_s: Tick at which it began.
        arrival_s: When it is delivered.
        terms: The eleven latency terms, s.
        dropped: Lost on the way.
        chunks: Sampled candidates, filled in by the batch. Shape (N, K, D_a).
        given_up: Its deadline has passed.
    """

    number: int
    metadata: ChunkMetadata
    observation: Array
    begun_s: float
    arrival_s: float
    terms: Mapping[str, float]
    dropped: bool
    chunks: Array | None = None
    given_up: bool = False


@dataclass
class Tally:
    """What a rollout counts while it runs."""

    action_ticks: int = 0
    hold_ticks: int = 0
    fallback_ticks: int = 0
    deadline_misses: int = 0
    rejections: int = 0
    interventions: int = 0
    force_peak_n: float = 0.0
    rejected_by: dict[str, int] = field(default_factory=dict)
    latencies_s: list[float] = field(default_factory=list)
    path_m: list[Array] = field(default_factory=list)
