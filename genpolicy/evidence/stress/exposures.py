"""When what the sensors expose arrives at the policy: the newest that has is what it may see.

Each tick exposes one observation. It arrives after its four sensor terms have passed, if it is not
lost; both are drawn by the number of the exposure, so that every method sees the same at the same
time. A later one may overtake an earlier one, which is then of no use.
"""

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import ChunkMetadata
from genpolicy.contract.latency import Term
from genpolicy.evidence.stress.perturbations import sensing
from genpolicy.evidence.stress.state import Setup
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal
from genpolicy.seeds import stream

Array = NDArray[np.float64]

SENSOR_TERMS = (Term.EXPOSURE, Term.CAPTURE, Term.DECODE, Term.TRANSFER)
"""What passes before an observation is there, in the order in which it is drawn."""


@dataclass(frozen=True, order=True)
class Exposure:
    """One observation on its way; ordered by when it comes.

    Attributes:
        arrival_s: When it is there, s; infinite where it is lost.
        number: Count of exposures in this rollout.
        exposed_s: When it was exposed, s.
        terms_s: What each sensor term takes, s, by name.
        observation: What was seen. Shape (D_o,).
        phase: Task phase then.
        calibration_epoch: Calibration in force then.
    """

    arrival_s: float
    number: int
    exposed_s: float = field(compare=False)
    terms_s: dict[str, float] = field(compare=False)
    observation: Array = field(compare=False)
    phase: str = field(compare=False)
    calibration_epoch: str = field(compare=False)


def sensor_terms(setup: Setup, *, start: int, number: int) -> tuple[dict[str, float], bool]:
    """What each sensor term of an exposure takes, s, and whether it is lost on the way.

    Args:
        setup: Declared terms, schedule and root seed.
        start: Index of the initial state; key of the draw.
        number: Count of exposures in this rollout; key of the draw.
    """
    key = ("exposed", setup.perturbation, start, number)
    *lots, falls, lot = map(float, stream(setup.root_seed, *key).random(len(SENSOR_TERMS) + 2))
    hit = sensing(setup.schedule, falls=falls, lot=lot)
    terms_s = {}
    for name, share in zip(map(str, SENSOR_TERMS), lots, strict=True):
        bounds = setup.latency.declared[name]
        own_s = bounds.minimum_s + share * (bounds.maximum_s - bounds.minimum_s)
        terms_s[name] = own_s + hit.extra_s.get(name, 0.0)
    return terms_s, hit.dropped


def conditioned_on(
    exposure: Exposure, setup: Setup, executor: Executor, *, chunk_id: str
) -> ChunkMetadata:
    """Metadata of the first candidate of an invocation that begins now, and sees this exposure.

    Its rows count from the exposure, as those of what the policy was trained on.
    """
    exposed_s, horizons = exposure.exposed_s, setup.horizons
    return ChunkMetadata(
        chunk_id=chunk_id,
        condition_observation_event_time_s=exposed_s,
        policy_checkpoint_hash=setup.checkpoint,
        sampler_config_hash=setup.sampler,
        action_start_time_s=exposed_s,
        action_period_s=horizons.action_period_s,
        valid_until_s=exposed_s + horizons.execution_horizon * horizons.action_period_s,
        task_phase=exposure.phase,
        calibration_epoch=exposure.calibration_epoch,
        predecessor_chunk_id=executor.chain_head,
        session_epoch=executor.session_epoch,
        method=setup.method,
        candidate_index=0,
    )


class Exposures:
    """What one rollout has exposed, and what of it is there.

    Args:
        setup: What the rollout shares with the others.
        journal: Of the rollout.
        start: Index of the initial state; key of the draws.

    Attributes:
        newest: The newest that has arrived; None before the first.
    """

    def __init__(self, setup: Setup, journal: Journal, *, start: int) -> None:
        self.newest: Exposure | None = None
        self._setup, self._journal, self._start = setup, journal, start
        self._number = 0
        self._coming: list[Exposure] = []
        self._arrived: list[Exposure] = []

    def expose(self, now_s: float, observation: Array, phase: str, epoch: str) -> None:
        """An observation is exposed now. Shape (D_o,)."""
        terms_s, lost = sensor_terms(self._setup, start=self._start, number=self._number)
        arrival_s = math.inf if lost else now_s + sum(terms_s.values())
        self._journal.exposure(now_s, observation)
        if not lost:
            one = Exposure(arrival_s, self._number, now_s, terms_s, observation, phase, epoch)
            heapq.heappush(self._coming, one)
        self._number += 1

    def arriving(self, until_s: float) -> Iterator[Exposure]:
        """What arrives before a time, on record, and is newer than all that has, in its order."""
        while self._coming and self._coming[0].arrival_s < until_s:
            one = heapq.heappop(self._coming)
            self._journal.arrived(one.arrival_s, exposed_s=one.exposed_s)
            self._arrived = sorted([*self._arrived, one], key=lambda seen: seen.number)
            self._arrived = self._arrived[-self._setup.horizons.observation_horizon :]
            if self.newest is None or one.number > self.newest.number:
                self.newest = one
                yield one

    def conditioning(self) -> Array:
        """The last H_o observations that are there, oldest first. Shape (H_o, D_o).

        Where fewer are, the first is repeated.
        """
        seen = [one.observation for one in self._arrived]
        missing = self._setup.horizons.observation_horizon - len(seen)
        return np.stack([seen[0]] * missing + seen)
