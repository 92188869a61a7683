"""Gate B's evidence: does a checkpoint come back the same, and what does fewer NFE cost?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.need.held_out import HeldOut, held_out_situations, modes_of_policy
from genpolicy.evidence.reproducibility.measure import in_fresh_process
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_file
from genpolicy.integrity.tables import read_table, write_table
from genpolicy.policies.checkpoint import CONFIG_FILE
from genpolicy.policies.fixtures import compare_fixtures, reload_fixture
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.statistics.intervals import clopper_pearson
from genpolicy.tasks.api import Task


@dataclass(frozen=True)
class ReloadPlan:
    """What is reloaded and swept.

    Attributes:
        checkpoints: Root folder of the trained methods.
        dataset: Folder of the dataset.
        audit: Folder of the audit.
        methods: Candidates.
        seeds: Training seeds.
        fixtures: Observations per fixture.
        sweep: Sampler steps to try, by method.
        samples: Candidates per situation in the sweep.
        horizons: Common horizons.
    """

    checkpoints: Path
    dataset: Path
    audit: Path
    methods: Sequence[str]
    seeds: Sequence[int]
    fixtures: int
    sweep: Mapping[str, Sequence[int]]
    samples: int
    horizons: HorizonConfig


def write_reload(
    plan: ReloadPlan, folder: Path, *, task: Task, checker: FeasibilityChecker
) -> None:
    """Reload every checkpoint in a fresh process, compare, sweep the NFE, write the evidence."""
    data = load_dataset(plan.dataset)
    held_out = held_out_situations(plan.audit, data, horizons=plan.horizons)
    written = read_table(plan.checkpoints / "fixtures.parquet").to_pylist()
    samples, nfe, coverage, identity = [], [], [], {}
    for method in plan.methods:
        mismatches = nonfinite = 0
        for seed in plan.seeds:
            source = plan.checkpoints / method / f"seed_{seed}"
            before = [row for row in written if (row["method"], row["seed"]) == (method, seed)]
            after = in_fresh_process(
                reload_fixture,
                source,
                plan.dataset,
                horizons=plan.horizons,
                method=method,
                seed=seed,
                count=plan.fixtures,
            )
            rows, differing = compare_fixtures(before, after)
            samples += rows
            mismatches += differing
            policy = load_policy(source)
            nonfinite += nonfinite_weights(policy)
            nfe.append(
                {
                    "method": method,
                    "seed": seed,
                    "recorded": before[0]["nfe"],
                    "counted": after[0]["nfe"],
                }
            )
            coverage += _sweep(plan, policy, held_out, seed, task=task, checker=checker)
        identity[method] = _identity(plan, method) | {
            "metadata_mismatches": mismatches,
            "nonfinite_weights": nonfinite,
        }
    write_table(folder / "samples.parquet", pa.Table.from_pylist(samples, SAMPLES))
    write_table(folder / "nfe.parquet", pa.Table.from_pylist(nfe, NFE))
    write_table(folder / "coverage.parquet", pa.Table.from_pylist(coverage, COVERAGE))
    write_bytes(folder / "identity.json", canonical_json(identity))


def nonfinite_weights(policy: NetworkPolicy) -> int:
    """Weights that are NaN or infinite."""
    state = policy.checkpoint.network.state_dict()
    return sum(int((~values.isfinite()).sum()) for values in state.values())


def _sweep(
    plan: ReloadPlan,
    policy: NetworkPolicy,
    held_out: HeldOut,
    seed: int,
    *,
    task: Task,
    checker: FeasibilityChecker,
) -> list[dict[str, Any]]:
    own = policy.sampler.steps
    rows = []
    for steps in sorted({own, *plan.sweep.get(policy.method, ())}):
        sampler = policy.sampler.model_copy(update={"steps": steps})
        found = modes_of_policy(
            NetworkPolicy(policy.checkpoint, sampler=sampler),
            held_out,
            seed=seed,
            convention=sampler.name,
            samples=plan.samples,
            task=task,
            checker=checker,
        )
        if not found:
            continue
        whole = sum(row["modes_covered"] == row["modes_present"] for row in found)
        drawn = sum(row["samples"] for row in found)
        rows.append(
            {
                "method": policy.method,
                "seed": seed,
                "steps": steps,
                "nfe": found[0]["nfe"],
                "situations": len(found),
                "modes_covered_share": whole / len(found),
                "coverage_lower": clopper_pearson(whole, len(found))[0],
                "spread_m": float(np.mean([row["spread_m"] for row in found])),
                "admissible_share": sum(row["admissible"] for row in found) / drawn,
                "between_share": sum(row["between_modes"] for row in found) / drawn,
            }
        )
    return rows


def _identity(plan: ReloadPlan, method: str) -> dict[str, Any]:
    """Everything that pins a candidate, by hash; the first seed is the one that is promoted."""
    folders = [plan.checkpoints / method / f"seed_{seed}" for seed in plan.seeds]
    policies = [load_policy(folder) for folder in folders]
    first = policies[0].checkpoint.config
    return {
        "checkpoint": policies[0].checkpoint_hash,
        "checkpoints": [policy.checkpoint_hash for policy in policies],
        "config": [sha256_file(folder / CONFIG_FILE) for folder in folders],
        "dataset": first.provenance.dataset_manifest_sha256,
        "normalisation": sha256_bytes(canonical_json(first.normalisation.model_dump())),
        "seed": [policy.checkpoint.config.training_seed for policy in policies],
        "sampler": policies[0].sampler_config_hash,
    }


SAMPLES = pa.schema(
    [
        ("method", pa.string()), ("seed", pa.int64()), ("row", pa.int64()),
        ("sha256_trained", pa.string()), ("sha256_reloaded", pa.string()),
        ("max_abs_difference", pa.float64()),
    ]
)  # fmt: skip
NFE = pa.schema(
    [
        ("method", pa.string()), ("seed", pa.int64()), ("recorded", pa.int64()),
        ("counted", pa.int64()),
    ]
)  # fmt: skip
COVERAGE = pa.schema(
    [
        ("method", pa.string()), ("seed", pa.int64()), ("steps", pa.int64()),
        ("nfe", pa.int64()), ("situations", pa.int64()), ("modes_covered_share", pa.float64()),
        ("coverage_lower", pa.float64()), ("spread_m", pa.float64()),
        ("admissible_share", pa.float64()), ("between_share", pa.float64()),
    ]
)  # fmt: skip
