"""Measured latency of every method, twice in fresh processes; and the virtual clock's models."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from genpolicy.contract.chunk import Proposal
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import ContractError
from genpolicy.evidence.admission_context import context_at_rest, make_checker, recorded_proposal
from genpolicy.evidence.reproducibility.benchmark import measure_policy
from genpolicy.evidence.reproducibility.measure import in_fresh_process
from genpolicy.evidence.stress.latency import (
    DECLARED_TERMS,
    MEASURED_TERMS,
    DeclaredTerm,
    LatencyModel,
)
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.policies.fixtures import fixture_observations
from genpolicy.policies.policy import load_policy
from genpolicy.tasks.api import load_task

Array = NDArray[np.float64]

RUNS = (1, 2)

LATENCY = pa.schema(
    [
        ("method", pa.string()), ("run", pa.int64()), ("component", pa.string()),
        ("temperature", pa.string()), ("repeat", pa.int64()), ("seconds", pa.float64()),
        ("source", pa.string()),
    ]
)  # fmt: skip


class DeclaredSettings(Settings):
    """Bounds of a term that this machine cannot measure, s."""

    minimum_s: float
    maximum_s: float


@dataclass(frozen=True)
class LatencyJob:
    """One method, measured by one fresh process.

    Attributes:
        checkpoint: Checkpoint folder.
        sha256: Its identity.
        dataset: Folder of the dataset, for realistic observations.
        task: Registered name of the task.
        feasibility: Thresholds of the six layers; their run time is the term `project`.
        horizons: Common horizons.
        warm: Warm invocations.
        cold: Cold invocations.
    """

    checkpoint: Path
    sha256: str
    dataset: Path
    task: str
    feasibility: FeasibilitySettings
    horizons: HorizonConfig
    warm: int
    cold: int


def latency_rows(
    jobs: Mapping[str, LatencyJob],
    declared: Mapping[str, DeclaredSettings],
    *,
    declared_draws: int,
    generator: np.random.Generator,
) -> list[dict[str, Any]]:
    """Rows of `latency.parquet`: two independent runs per method, and the declared terms."""
    rows: list[dict[str, Any]] = []
    for method, job in jobs.items():
        for run in RUNS:
            measured = in_fresh_process(measure_job, job)
            rows += [{"method": method, "run": run, "source": "measured", **m} for m in measured]
    for name in DECLARED_TERMS:
        bounds = declared[name]
        drawn = generator.uniform(bounds.minimum_s, bounds.maximum_s, size=declared_draws)
        rows += [
            {
                "method": method,
                "run": RUNS[0],
                "component": name,
                "temperature": "warm",
                "repeat": repeat,
                "seconds": float(value),
                "source": "declared",
            }
            for method in jobs
            for repeat, value in enumerate(drawn)
        ]
    return rows


def measure_job(job: LatencyJob) -> list[dict[str, Any]]:
    """Cold and warm spans of one method, with the six layers timed as `project`."""
    data = load_dataset(job.dataset)
    observations = fixture_observations(data, horizons=job.horizons, count=32)
    task = load_task(job.task)
    checker = make_checker(task, job.feasibility)
    contexts = [
        context_at_rest(
            task,
            checker,
            row[-1],
            execution_horizon=job.horizons.execution_horizon,
        )
        for row in observations
    ]
    policy = load_policy(job.checkpoint, expected_sha256=job.sha256)
    calls = 0

    def project(proposal: Proposal) -> object:
        nonlocal calls
        row = calls % len(observations)
        calls += 1
        recorded = recorded_proposal(
            task,
            proposal.actions,
            observations[row][-1],
            action_period_s=policy.horizons.action_period_s,
            chunk_id=proposal.metadata.chunk_id,
        )
        return checker.admit(recorded, context=contexts[row])

    measured = measure_policy(
        job.checkpoint,
        observations,
        expected_sha256=job.sha256,
        cold_repeats=job.cold,
        warm_repeats=job.warm,
        project=project,
    )
    return [asdict(measurement) for measurement in measured]


def latency_models(
    table: pd.DataFrame, declared: Mapping[str, DeclaredSettings]
) -> dict[str, LatencyModel]:
    """The virtual clock's model of each method, from `latency.parquet`.

    Raises:
        ContractError: A method lacks a measured term.
    """
    bounds = {name: DeclaredTerm(item.minimum_s, item.maximum_s) for name, item in declared.items()}
    models = {}
    measured = table[table["source"] == "measured"]
    for method, rows in measured.groupby("method", sort=True):
        warm, cold = rows[rows["temperature"] == "warm"], rows[rows["temperature"] == "cold"]
        terms = {
            str(name): np.sort(part["seconds"].to_numpy(dtype=np.float64))
            for name, part in warm.groupby("component", sort=True)
        }
        missing = [name for name in MEASURED_TERMS if name not in terms]
        if missing or len(cold) == 0:
            raise ContractError(
                where=f"latency of {method}",
                found=f"without {missing or 'cold invocations'}",
                expected="every measured term, cold and warm",
                action="Run the latency stage again (`dvc repro latency`).",
            )
        first = float(cold.groupby(["run", "repeat"])["seconds"].sum().max())
        typical = float(warm.groupby(["run", "repeat"])["seconds"].sum().median())
        models[str(method)] = LatencyModel(bounds, terms, max(0.0, first - typical))
    return models
