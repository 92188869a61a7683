"""The task's classical planner as a policy: compared, timed and asked again like every other one.

It has no weights. What it is, is the task: its identity covers every file of the task's package.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.planner import PLANNER, planner_sha256
from genpolicy.errors import ConfigError, ContractError, IntegrityError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.protocol import NoiseName, Samples, check_finite
from genpolicy.tasks.api import load_task
from genpolicy.tasks.identity import task_identity
from genpolicy.tasks.planner import Planner, planner_of

Array = NDArray[np.float64]

SAMPLER_SHA256 = sha256_bytes(canonical_json({"name": "planned"}))
"""Of the settings of its sampler: it has none."""


class PlannerPolicy:
    """A task's planner; see `Policy`. It draws nothing: all candidates of an observation are one.

    Args:
        planner: The task's.
        sha256: Its identity.
        horizons: Of the ladder.
        observation_dim: D_o.
    """

    method = PLANNER
    stochastic = False
    guided = False
    sampler_config_hash = SAMPLER_SHA256

    def __init__(
        self, planner: Planner, *, sha256: str, horizons: HorizonConfig, observation_dim: int
    ) -> None:
        self._planner, self._dim = planner, observation_dim
        self._sha256, self._horizons = sha256, horizons

    @property
    def checkpoint_hash(self) -> str:
        """Identity of the planner."""
        return self._sha256

    @property
    def horizons(self) -> HorizonConfig:
        """Those of the ladder."""
        return self._horizons

    @property
    def prediction_horizon(self) -> int:
        """K, actions of one chunk."""
        return self._horizons.prediction_horizon

    def sample(
        self,
        observations: Array,
        *,
        noise_names: Sequence[NoiseName],
        candidates: int,
        prefix: Prefix | None = None,
    ) -> Samples:
        """The chunk of each observation (B, H_o, D_o), as often as candidates are asked for.

        Raises:
            ConfigError: A prefix: a planner goes on from where it sees the arm.
            ContractError: Wrong shape, no candidate, or a chunk of another shape.
            NonFiniteError: An observation is NaN or infinite.
        """
        if prefix is not None:
            raise ConfigError(
                where=f"a prefix for {PLANNER}",
                found="given",
                expected="none: it plans from where it sees the arm",
                action=f"Name {PLANNER} in stress.joining.exempt.",
            )
        if len(noise_names) != len(observations) or not candidates >= 1:
            raise ContractError(
                where=f"an invocation of {PLANNER}",
                found=f"{len(observations)} observations, {len(noise_names)} noise names, "
                f"{candidates} candidates",
                expected="one noise name per observation and at least one candidate",
                action="Name the noise of every row.",
            )
        chunks = self.plan(self.preprocess(observations))
        return Samples(np.repeat(chunks[:, None], candidates, axis=1), nfe=0)

    def preprocess(self, observations: Array) -> Array:
        """Observations (B, H_o, D_o), checked.

        Raises:
            ContractError: Wrong shape.
            NonFiniteError: NaN or infinity.
        """
        expected = (self._horizons.observation_horizon, self._dim)
        if observations.ndim != 3 or observations.shape[1:] != expected or not len(observations):
            raise ContractError(
                where=f"observations of {PLANNER}",
                found=f"of shape {observations.shape}",
                expected=f"(B, {expected[0]}, {expected[1]}) with B >= 1",
                action="Deliver the last H_o observation vectors.",
            )
        check_finite(observations, f"observations of {PLANNER}", "Hold.")
        return observations

    def plan(self, observations: Array) -> Array:
        """Chunks (B, K, D_a) of observations (B, H_o, D_o), each planned alone.

        Raises:
            ContractError: The planner gives a chunk of another shape.
        """
        return np.stack([self._planned(history) for history in observations])

    def _planned(self, history: Array) -> Array:
        chunk = np.asarray(
            self._planner(np.array(history), horizons=self._horizons), dtype=np.float64
        )
        if chunk.shape != (self.prediction_horizon, ACTION_DIM):
            raise ContractError(
                where="a chunk of the task's planner",
                found=f"of shape {chunk.shape}",
                expected=f"({self.prediction_horizon}, {ACTION_DIM})",
                action="Correct `planner` in the task's package.",
            )
        return chunk


@dataclass(frozen=True)
class PlannedPolicy:
    """The planner of a task, among those that are compared.

    Attributes:
        task: Registered name of the task.
        horizons: Of the ladder.
        sha256: Its identity; `load` refuses another one.
        seed: Number of the training seed under which it stands in tables, that which is promoted.
    """

    task: str
    horizons: HorizonConfig
    sha256: str
    seed: int
    name: Literal["classical_planner"] = PLANNER

    def load(self) -> PlannerPolicy:
        """The policy.

        Raises:
            ConfigError: The task offers no planner.
            IntegrityError: The task's files are not those of the identity.
        """
        task = load_task(self.task)
        planner = planner_of(task)
        if planner is None:
            raise _offers_none(self.task)
        found = planner_sha256(task_identity(self.task)["sha256"])
        if found != self.sha256:
            raise IntegrityError(
                where=f"the planner of {self.task}",
                found=f"that of a task of SHA-256 {found[:16]}…",
                expected=f"{self.sha256[:16]}…",
                action="Run the ladder again: the task's package was edited meanwhile.",
            )
        return PlannerPolicy(
            planner, sha256=found, horizons=self.horizons, observation_dim=task.observation.dim
        )


def planned(task: str, horizons: HorizonConfig, *, seed: int) -> PlannedPolicy:
    """The planner of a registered task.

    Raises:
        ConfigError: No task of that name, or it offers no planner.
    """
    if planner_of(load_task(task)) is None:
        raise _offers_none(task)
    return PlannedPolicy(task, horizons, planner_sha256(task_identity(task)["sha256"]), seed)


def require_compared(task: str, baselines: Sequence[str], *, rehearsal: bool) -> None:
    """Require that a planner is among the simple methods where the task offers one, and only there.

    Args:
        task: Registered name of the task.
        baselines: Simple methods of the comparison.
        rehearsal: Whether it may be left out, as of a ladder that leads to no card.

    Raises:
        ConfigError: It is named and there is none, or there is one and nobody compares it.
    """
    offered = planner_of(load_task(task)) is not None
    if PLANNER in baselines and not offered:
        raise _offers_none(task)
    if offered and PLANNER not in baselines and not rehearsal:
        raise ConfigError(
            where="params.yaml: stress.baselines",
            found=f"without {PLANNER}",
            expected=f"with it: {task} offers a planner, which a candidate must beat",
            action="Add it; a rehearsal may leave it out.",
        )


def _offers_none(task: str) -> ConfigError:
    return ConfigError(
        where="params.yaml: stress.baselines",
        found=f"with {PLANNER}",
        expected=f"without it: {task} offers no planner",
        action="Remove it, or give the task's package a `planner`.",
    )
