"""Which part earns what: representation, trunk, head and temporal design, each changed alone.

After Haldar et al., arXiv 2406.07539: one reference policy, and variants that differ from it in
one factor. All are trained with the same number of updates on the same windows, and measured on
the same held-out rows and situations, so that no head is credited for an encoder.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pydantic import Field

from genpolicy.compute import map_shards
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.errors import ConfigError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.need.effects import EFFECTS, effect_rows
from genpolicy.evidence.need.held_out import held_out_situations, modes_of_policy
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.integrity.tables import write_table
from genpolicy.policies.checkpoint import CONFIG_FILE, Provenance
from genpolicy.policies.matched_training import (
    SINGLE_ACTION_KEYS,
    PolicySettings,
    TrainingJob,
    differing_keys,
    train_job,
    training_windows,
)
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.training import TrainingRequest
from genpolicy.seeds import integer_seed
from genpolicy.tasks.api import load_task

Array = NDArray[np.float64]
Rows = list[dict[str, Any]]
Factor = Literal["reference", "representation", "trunk", "head", "temporal"]

SPLITS = ("validation", "test")
# What each factor may change; anything else is a second factor.
FACTOR_KEYS: dict[str, tuple[str, ...]] = {
    "reference": (),
    "representation": (
        "network.encoder", "horizons.observation_horizon", "dimensions.observation_horizon",
    ),
    "trunk": ("network.trunk",),
    "head": ("method", "sampler.name", "sampler.steps", "sampler.population"),
    "temporal": ("method", *SINGLE_ACTION_KEYS),
}  # fmt: skip


class Variant(Settings):
    """The reference, or one change of it.

    Attributes:
        factor: The factor that is changed.
        method: Registered method.
        sampler: Its sampler.
        conventions: Further samplers to measure the same checkpoint with, by name.
        encoder: Encoder of the network.
        trunk: Trunk of the network.
        observation_horizon: H_o, where it differs from the common one.
    """

    factor: Factor
    method: str = "chunked_bc"
    sampler: SamplerConfig = SamplerConfig(name="direct")
    conventions: dict[str, SamplerConfig] = Field(default_factory=dict)
    encoder: Literal["mlp", "linear"] = "mlp"
    trunk: Literal["mlp", "transformer"] = "mlp"
    observation_horizon: int | None = None


@dataclass(frozen=True)
class FactorStudy:
    """Everything the separation needs besides its folders; see `study.Study`.

    Attributes:
        task: Registered name of the task.
        variants: Variants by name, exactly one of them the reference.
        settings: What all share; training steps are those of this study.
        horizons: Common horizons.
        feasibility: Thresholds of the six layers.
        samples: Candidates per situation of a convention that draws.
        stride: Every so many held-out windows are compared.
        root_seed: Root seed.
        device: Torch device of training.
        workers: Local processes.
        scheduler: `local` or the address of a Dask scheduler.
    """

    task: str
    variants: Mapping[str, Variant]
    settings: PolicySettings
    horizons: HorizonConfig
    feasibility: FeasibilitySettings
    samples: int
    stride: int
    root_seed: int
    device: str
    workers: int
    scheduler: str


@dataclass(frozen=True)
class VariantJob:
    """One variant and seed, trained and measured by one process."""

    study: FactorStudy
    name: str
    seed: int
    training: TrainingJob
    audit: Path


def run_factors(study: FactorStudy, *, dataset: Path, audit: Path, folder: Path) -> None:
    """Train and measure all variants; write tables of errors, modes, effects, and `factors.json`.

    Raises:
        ConfigError: Not exactly one reference.
    """
    names = [name for name, variant in study.variants.items() if variant.factor == "reference"]
    if len(names) != 1:
        raise ConfigError(
            where="factors.variants",
            found=f"{len(names)} references",
            expected="exactly one",
            action="Mark the variant that the others are changes of.",
        )
    data = load_dataset(dataset)
    jobs = [
        _job(study, data, name=name, seed=seed, dataset=dataset, audit=audit, folder=folder)
        for seed in study.settings.seeds
        for name in study.variants
    ]
    parts = map_shards(measure, jobs, workers=study.workers, scheduler=study.scheduler)
    errors = [row for part in parts for row in part[0]]
    modes = [row for part in parts for row in part[1]]
    write_table(folder / "errors.parquet", pa.Table.from_pylist(errors, ERRORS))
    write_table(folder / "modes.parquet", pa.Table.from_pylist(modes, MODES))
    effects = effect_table(study, errors, modes, reference=names[0])
    write_table(folder / "effects.parquet", pa.Table.from_pylist(effects, EFFECTS))
    configs = {
        job.name: read_json(job.training.folder / CONFIG_FILE)
        for job in jobs
        if job.seed == study.settings.seeds[0]
    }
    write_bytes(folder / "factors.json", canonical_json(isolation(study, configs, names[0])))


def effect_table(study: FactorStudy, errors: Rows, modes: Rows, *, reference: str) -> Rows:
    """Rows of `effects.parquet`: what each variant and convention changes, paired by episode."""
    base = (reference, study.variants[reference].sampler.name)
    rows: Rows = []
    for name, variant in study.variants.items():
        single = variant.factor == "temporal"
        for convention in (variant.sampler.name, *variant.conventions):
            named = {"variant": name, "factor": variant.factor, "convention": convention}
            rows += [
                {**named, **row}
                for row in effect_rows(
                    errors,
                    modes,
                    own=(name, convention),
                    reference=base,
                    error="first_error" if single else "chunk_error",
                )
            ]
    return rows


def isolation(
    study: FactorStudy, configs: Mapping[str, Mapping[str, Any]], reference: str
) -> dict[str, Any]:
    """What every variant changes against the reference, and what its factor may change."""
    return {
        "reference": reference,
        "steps": study.settings.training.steps,
        "variants": {
            name: {
                "factor": variant.factor,
                "method": variant.method,
                "parameters": configs[name]["parameters"],
                "changed": differing_keys(configs[reference], configs[name]),
                "allowed": list(FACTOR_KEYS[variant.factor]),
                "prediction_horizon": configs[name]["horizons"]["prediction_horizon"],
            }
            for name, variant in study.variants.items()
        },
    }


def measure(job: VariantJob) -> tuple[Rows, Rows]:
    """Train one variant; rows of `errors.parquet` and `modes.parquet` of each convention."""
    sha256 = train_job(job.training)
    data = load_dataset(job.training.dataset)
    variant = job.study.variants[job.name]
    own = {variant.sampler.name: variant.sampler, **variant.conventions}
    checkpoint = load_policy(job.training.folder, expected_sha256=sha256).checkpoint
    errors: Rows = []
    modes: Rows = []
    for convention, sampler in own.items():
        policy = NetworkPolicy(checkpoint, sampler=sampler)
        named = {"variant": job.name, "factor": variant.factor}
        measured = {**named, "seed": job.seed, "convention": convention}
        errors += [{**measured, **row} for row in error_rows(job, data, policy)]
        modes += [{**row, **named} for row in _mode_rows(job, data, policy, convention)]
    return errors, modes


def error_rows(job: VariantJob, data: Dataset, policy: NetworkPolicy) -> Rows:
    """Errors of one sampled chunk per held-out window, mean per episode, normalised units.

    The error of the first action stands beside that of the chunk: it is what a policy of one
    action can be compared by.
    """
    horizons, stride = job.training.request.horizons, job.study.stride
    rows: Rows = []
    for split in SPLITS:
        cut = data.windows(
            split,
            observation_horizon=horizons.observation_horizon,
            prediction_horizon=horizons.prediction_horizon,
        )
        windows = training_windows(data, split, horizons)
        some = slice(None, None, stride)
        steps = policy.prediction_horizon
        drawn = policy.sample(
            windows.observations[some],
            noise_names=[
                ("factors", int(e), int(i))
                for e, i in zip(cut.episode[some], cut.index[some], strict=True)
            ],
            candidates=1,
        ).actions[:, 0]
        scale = data.normalisation.action
        target = scale.normalise(windows.actions[some, :steps])
        error = np.abs(scale.normalise(drawn) - target).mean(axis=2)
        counts = ~windows.is_pad[some, :steps]
        uuids = data.episodes["episode_uuid"].to_numpy()
        for episode in np.unique(cut.episode[some]):
            inside = cut.episode[some] == episode
            rows.append(
                {
                    "split": split,
                    "episode_uuid": str(uuids[episode]),
                    "windows": int(inside.sum()),
                    "chunk_error": float(error[inside][counts[inside]].mean()),
                    "first_error": float(error[inside, 0].mean()),
                }
            )
    return rows


def _mode_rows(job: VariantJob, data: Dataset, policy: NetworkPolicy, convention: str) -> Rows:
    study = job.study
    task = load_task(study.task)
    held_out = held_out_situations(job.audit, data, horizons=job.training.request.horizons)
    return modes_of_policy(
        policy,
        held_out,
        seed=job.seed,
        convention=convention,
        samples=study.samples if policy.stochastic else 1,
        task=task,
        checker=make_checker(task, study.feasibility),
    )


def _job(
    study: FactorStudy,
    data: Dataset,
    *,
    name: str,
    seed: int,
    dataset: Path,
    audit: Path,
    folder: Path,
) -> VariantJob:
    variant = study.variants[name]
    changes = {"encoder": variant.encoder, "trunk": variant.trunk}
    seen = variant.observation_horizon or study.horizons.observation_horizon
    request = TrainingRequest(
        method=variant.method,
        horizons=study.horizons.model_copy(update={"observation_horizon": seen}),
        normalisation=data.normalisation,
        network=study.settings.network.model_copy(update=changes),
        head=study.settings.head,
        training=study.settings.training,
        sampler=variant.sampler,
        provenance=Provenance(
            dataset_manifest_sha256=data.manifest_sha256,
            action_contract_sha256=data.manifest["action_contract"]["sha256"],
            observation_contract_sha256=data.manifest["observation_contract"]["sha256"],
        ),
        seed=integer_seed(study.root_seed, "training", seed),
    )
    training = TrainingJob(
        dataset=dataset,
        folder=folder / name / f"seed_{seed}",
        request=request,
        device=study.device,
    )
    return VariantJob(study=study, name=name, seed=seed, training=training, audit=audit)


ERRORS = pa.schema(
    [
        ("variant", pa.string()), ("factor", pa.string()), ("seed", pa.int64()),
        ("convention", pa.string()), ("split", pa.string()), ("episode_uuid", pa.string()),
        ("windows", pa.int64()), ("chunk_error", pa.float64()), ("first_error", pa.float64()),
    ]
)  # fmt: skip
MODES = pa.schema(
    [
        ("variant", pa.string()), ("factor", pa.string()), ("method", pa.string()),
        ("seed", pa.int64()), ("convention", pa.string()), ("episode_uuid", pa.string()),
        ("index", pa.int64()), ("samples", pa.int64()), ("modes_present", pa.int64()),
        ("modes_covered", pa.int64()), ("between_modes", pa.int64()),
        ("admissible", pa.int64()), ("nfe", pa.int64()), ("spread_m", pa.float64()),
    ]
)  # fmt: skip
