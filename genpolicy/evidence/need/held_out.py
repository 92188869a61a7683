"""Held-out situations with several modes: which of them does a policy reach, and how well?"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset
from genpolicy.errors import ContractError
from genpolicy.evidence.admission_context import admissible
from genpolicy.evidence.need.method_modes import (
    ModeSituation,
    one_per_episode,
    read_situations,
    sample_modes,
)
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.policies.protocol import Policy
from genpolicy.tasks.api import Task

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeldOut:
    """Situations and the observations that condition an invocation there.

    Attributes:
        situations: One per held-out episode and phase.
        observations: Shape (S, H_o, D_o).
    """

    situations: tuple[ModeSituation, ...]
    observations: Array


def held_out_situations(audit: Path, dataset: Dataset, *, horizons: HorizonConfig) -> HeldOut:
    """Persistent situations with several modes, from the audit, with their observations.

    Raises:
        ContractError: The audit names a row that the dataset does not have.
    """
    situations = tuple(one_per_episode(read_situations(audit)))
    rows = _rows(dataset, [(s.episode_uuid, s.index) for s in situations])
    first = rows - np.array([s.index for s in situations], dtype=np.int64)
    back = np.arange(1 - horizons.observation_horizon, 1)
    seen = np.maximum(rows[:, None] + back, first[:, None])
    return HeldOut(situations, dataset.frames.observation[seen])


def modes_of_policy(
    policy: Policy,
    held_out: HeldOut,
    *,
    seed: int,
    convention: str,
    samples: int,
    task: Task,
    checker: FeasibilityChecker,
) -> list[ModeRow]:
    """Rows of `modes.parquet`: modes reached and admissible samples, per situation.

    A chunk that is not finite is a sample like any other: no layer passes it, and it is far from
    every mode.
    """
    if not held_out.situations:
        return []
    names = [("modes", s.episode_uuid, s.index) for s in held_out.situations]
    drawn = policy.sample(held_out.observations, noise_names=names, candidates=samples)
    rows = []
    for situation, observation, chunks in zip(
        held_out.situations, held_out.observations[:, -1], drawn.actions, strict=True
    ):
        reached = sample_modes(chunks, situation.mode_paths, position=POSITION)
        passed = admissible_chunks(
            task, checker, chunks, observation, action_period_s=policy.horizons.action_period_s
        )
        valid = reached.counts(passed)
        rows.append(
            ModeRow(
                method=policy.method,
                seed=seed,
                convention=convention,
                episode_uuid=situation.episode_uuid,
                index=situation.index,
                samples=len(chunks),
                modes_present=reached.modes_present,
                modes_covered=reached.modes_covered,
                between_modes=int(reached.between.sum()),
                far_from_modes=int((reached.far & ~reached.between).sum()),
                admissible=int(passed.sum()),
                valid=int(valid.sum()),
                modes_valid=int((valid > 0).sum()),
                fewest_admissible=int(valid.min()),
                nfe=drawn.nfe,
                spread_m=_spread_m(chunks[:, :, POSITION]),
            )
        )
    return rows


def _spread_m(paths_m: Array) -> float:
    """Mean standard deviation over those paths (S, K, P) that are finite, m; 0 of none."""
    finite = paths_m[np.isfinite(paths_m).all(axis=(1, 2))]
    return float(finite.std(axis=0).mean()) if len(finite) else 0.0


def admissible_chunks(
    task: Task,
    checker: FeasibilityChecker,
    chunks: Array,
    observation: Array,
    *,
    action_period_s: float,
) -> NDArray[np.bool_]:
    """Which chunks (S, K, D_a) pass all six layers at a recorded observation (D_o,). Shape (S,)."""
    verdicts = [
        admissible(task, checker, chunk, observation, action_period_s=action_period_s)[0]
        for chunk in chunks
    ]
    return np.array(verdicts, dtype=np.bool_)


def _rows(dataset: Dataset, wanted: Sequence[tuple[str, int]]) -> NDArray[np.int64]:
    episodes = dataset.episodes["episode_uuid"].tolist()
    lengths = dataset.episodes["rows"].to_numpy(dtype=np.int64)
    starts = dict(zip(episodes, np.cumsum(lengths) - lengths, strict=True))
    sizes = dict(zip(episodes, lengths, strict=True))
    rows = np.zeros(len(wanted), dtype=np.int64)
    for position, (uuid, index) in enumerate(wanted):
        if uuid not in starts or not 0 <= index < sizes[uuid]:
            raise ContractError(
                where=f"situation {uuid}, row {index}",
                found="not in the dataset",
                expected="a row of the dataset that the audit looked at",
                action="Run the audit on this dataset (`dvc repro audit`).",
            )
        rows[position] = starts[uuid] + index
    return rows
