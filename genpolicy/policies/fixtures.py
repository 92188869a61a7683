"""Evaluation fixtures: samples that a checkpoint must reproduce after save and reload."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import actions_sha256
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.errors import ContractError
from genpolicy.policies.policy import NetworkPolicy, load_policy

Array = NDArray[np.float64]

CANDIDATES = 2


@dataclass(frozen=True)
class FixtureRow:
    """`fixtures.parquet`: samples of one checkpoint at one observation, drawn at training.

    Attributes:
        method: The method.
        seed: Number of its training seed.
        row: Which observation.
        checkpoint: Identity of the weights.
        sampler: Hash of the sampler settings.
        nfe: Network evaluations of one invocation, counted.
        prediction_horizon: Actions of a chunk.
        sha256: Of the samples.
        samples: Every number of them, candidate by candidate.
    """

    method: str
    seed: int
    row: int
    checkpoint: str
    sampler: str
    nfe: int
    prediction_horizon: int
    sha256: str
    samples: tuple[float, ...]


@dataclass(frozen=True)
class Compared:
    """One fixture, before and after reload.

    Attributes:
        row: Which observation.
        sha256_trained: Of the samples drawn at training.
        sha256_reloaded: Of those drawn from the files.
        max_abs_difference: Largest difference of a number; NaN where one is no number.
    """

    row: int
    sha256_trained: str
    sha256_reloaded: str
    max_abs_difference: float


METADATA = ("checkpoint", "sampler", "nfe", "prediction_horizon")


def fixture_observations(data: Dataset, *, horizons: HorizonConfig, count: int) -> Array:
    """Evenly spaced observation histories of the test split. Shape (count, H_o, D_o)."""
    cut = data.windows(
        "test",
        observation_horizon=horizons.observation_horizon,
        prediction_horizon=1,
        only_success=False,
    )
    rows = np.linspace(0, len(cut.observations) - 1, num=count).round().astype(np.int64)
    chosen: Array = cut.observations[rows]
    return chosen


def fixture_rows(
    policy: NetworkPolicy, observations: Array, *, method: str, seed: int
) -> list[FixtureRow]:
    """Rows of `fixtures.parquet` for one checkpoint."""
    names = [("fixture", row) for row in range(len(observations))]
    drawn = policy.sample(observations, noise_names=names, candidates=CANDIDATES).finite()
    return [
        FixtureRow(
            method=method,
            seed=seed,
            row=row,
            checkpoint=policy.checkpoint_hash,
            sampler=policy.sampler_config_hash,
            nfe=drawn.nfe,
            prediction_horizon=policy.prediction_horizon,
            sha256=actions_sha256(chunks),
            samples=tuple(chunks.ravel().tolist()),
        )
        for row, chunks in enumerate(drawn.actions)
    ]


def reload_fixture(
    folder: Path, dataset: Path, *, horizons: HorizonConfig, method: str, seed: int, count: int
) -> list[FixtureRow]:
    """The fixtures again, from the files alone; to be called in a fresh process."""
    observations = fixture_observations(load_dataset(dataset), horizons=horizons, count=count)
    return fixture_rows(load_policy(folder), observations, method=method, seed=seed)


def compare_fixtures(
    trained: Sequence[FixtureRow], reloaded: Sequence[FixtureRow]
) -> tuple[list[Compared], int]:
    """Each fixture before and after, and how many metadata fields differ.

    Raises:
        ContractError: One side has rows that the other lacks.
    """
    if [_key(row) for row in trained] != [_key(row) for row in reloaded]:
        raise ContractError(
            where="fixtures after reload",
            found=f"{len(reloaded)} rows",
            expected=f"the {len(trained)} rows written at training",
            action="Train the generators again (`dvc repro train_generators`).",
        )
    rows, mismatches = [], 0
    for before, after in zip(trained, reloaded, strict=True):
        difference = np.abs(np.asarray(before.samples) - np.asarray(after.samples))
        rows.append(Compared(before.row, before.sha256, after.sha256, float(difference.max())))
        mismatches += sum(getattr(before, name) != getattr(after, name) for name in METADATA)
    return rows, mismatches


def _key(row: FixtureRow) -> tuple[str, int, int]:
    return row.method, row.seed, row.row
