"""Evaluation fixtures: samples that a checkpoint must reproduce after save and reload."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from genpolicy.contract.chunk import actions_sha256
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.errors import ContractError
from genpolicy.policies.policy import NetworkPolicy, load_policy

Array = NDArray[np.float64]

CANDIDATES = 2

FIXTURES = pa.schema(
    [
        ("method", pa.string()), ("seed", pa.int64()), ("row", pa.int64()),
        ("checkpoint", pa.string()), ("sampler", pa.string()), ("nfe", pa.int64()),
        ("prediction_horizon", pa.int64()), ("sha256", pa.string()),
        ("samples", pa.list_(pa.float64())),
    ]
)  # fmt: skip


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
) -> list[dict[str, Any]]:
    """Rows of `fixtures.parquet` for one checkpoint."""
    names = [("fixture", row) for row in range(len(observations))]
    drawn = policy.sample(observations, noise_names=names, candidates=CANDIDATES)
    return [
        {
            "method": method,
            "seed": seed,
            "row": row,
            "checkpoint": policy.checkpoint_hash,
            "sampler": policy.sampler_config_hash,
            "nfe": drawn.nfe,
            "prediction_horizon": policy.prediction_horizon,
            "sha256": actions_sha256(chunks),
            "samples": chunks.ravel().tolist(),
        }
        for row, chunks in enumerate(drawn.actions)
    ]


def reload_fixture(
    folder: Path, dataset: Path, *, horizons: HorizonConfig, method: str, seed: int, count: int
) -> list[dict[str, Any]]:
    """The fixtures again, from the files alone; to be called in a fresh process."""
    observations = fixture_observations(load_dataset(dataset), horizons=horizons, count=count)
    return fixture_rows(load_policy(folder), observations, method=method, seed=seed)


def compare_fixtures(
    trained: list[dict[str, Any]], reloaded: list[dict[str, Any]]
) -> tuple[list[dict[str, Any]], int]:
    """Rows of `samples.parquet`, and how many metadata fields differ.

    Raises:
        ContractError: One side has rows that the other lacks.
    """
    if [_key(row) for row in trained] != [_key(row) for row in reloaded]:
        raise ContractError(
            where="fixtures after reload",
            found=f"{len(reloaded)} rows",
            expected=f"the {len(trained)} rows written at training",
            action="Run the generators stage again (`dvc repro generators`).",
        )
    rows, mismatches = [], 0
    for before, after in zip(trained, reloaded, strict=True):
        difference = np.abs(np.asarray(before["samples"]) - np.asarray(after["samples"]))
        rows.append(
            {
                "method": before["method"],
                "seed": before["seed"],
                "row": before["row"],
                "sha256_trained": before["sha256"],
                "sha256_reloaded": after["sha256"],
                "max_abs_difference": float(difference.max()),
            }
        )
        fields = ("checkpoint", "sampler", "nfe", "prediction_horizon")
        mismatches += sum(before[name] != after[name] for name in fields)
    return rows, mismatches


def _key(row: dict[str, Any]) -> tuple[str, int, int]:
    return row["method"], row["seed"], row["row"]
