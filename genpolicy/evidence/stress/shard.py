"""What a shard of the matched comparison is, and what comes of it."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.contenders import Contender
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.evidence.fixtures_again import NO_FIXTURES
from genpolicy.evidence.rows.brought import FixtureAgainRow
from genpolicy.evidence.rows.stress import (
    FaultRow,
    InvocationRow,
    OverrunRow,
    RecoveryRow,
    RefusedRow,
    RolloutRow,
    SpliceRow,
    StressStubRow,
)
from genpolicy.evidence.stress.latency import LatencyModel
from genpolicy.evidence.stress.perturbations import Perturbation
from genpolicy.evidence.stress.settings import PersonSettings
from genpolicy.execution.cell import Cell
from genpolicy.execution.ledger import Account
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.tasks.api import NOMINAL_PROBE

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Comparison:
    """What all shards share.

    Attributes:
        task: Registered name of the task.
        starts: Initial states as JSON texts, in order.
        episode_limit_s: Longest rollout.
        samples: Candidates per invocation of a stochastic method.
        cell: Horizons, executor, supervisor and recovery.
        feasibility: Thresholds of the six layers.
        root_seed: Root seed.
        joining: How chunks join.
        person: Who comes when a person is called; None: nobody, and the call ends a rollout.
        fixtures: Those of Gate B, for who was brought. Shape (F, H_o, D_o).
    """

    task: str
    starts: tuple[str, ...]
    episode_limit_s: float
    samples: int
    cell: Cell
    feasibility: FeasibilitySettings
    root_seed: int
    joining: JoiningSettings = field(default_factory=JoiningSettings)
    person: PersonSettings | None = None
    fixtures: Array = field(default_factory=lambda: NO_FIXTURES, compare=False)


@dataclass(frozen=True)
class Shard:
    """One method under one perturbation, on all starts or on some that follow each other.

    Attributes:
        comparison: What all shards share.
        judged: The method's policy.
        latency: Latency of the method.
        perturbation: Name of the perturbation.
        schedule: What it injects.
        journal: File to write the journal to.
        probe: Probe of the task that its worlds are under.
        first: Number of its first start.
        end: Number behind its last start; None: all starts from the first on.
    """

    comparison: Comparison
    judged: Contender
    latency: LatencyModel
    perturbation: str
    schedule: Perturbation
    journal: Path
    probe: str = NOMINAL_PROBE
    first: int = 0
    end: int | None = None

    @property
    def numbers(self) -> range:
        """Numbers of its starts."""
        return range(len(self.comparison.starts))[self.first : self.end]


@dataclass(frozen=True)
class ShardResult:
    """Rows of a shard.

    Attributes:
        rollouts: One row per start.
        invocations: One row per invocation.
        splices: One row per chunk that entered a queue.
        recoveries: One row per entry into recovery.
        overruns: One row per term that took longer than it may.
        faults: One row per kind in which the policy's process failed.
        refused: One row per candidate that was refused, of the rollouts that are kept whole.
        accounts: Balance of chunks, per rollout.
        ages_s: Every action age, s.
        stub: Arrivals, stale and invalid offers.
        again: Gate B's fixtures, before and after; none of what runs here.
    """

    rollouts: list[RolloutRow]
    invocations: list[InvocationRow]
    splices: list[SpliceRow]
    recoveries: list[RecoveryRow]
    overruns: list[OverrunRow]
    faults: list[FaultRow]
    refused: list[RefusedRow]
    accounts: list[Account]
    ages_s: Array
    stub: StressStubRow
    again: list[FixtureAgainRow] = field(default_factory=list)
