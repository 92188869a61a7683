"""A matched study: train methods alike, then measure errors and modes on held-out data."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from genpolicy.compute import map_shards
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.need.held_out import held_out_situations, modes_of_policy
from genpolicy.evidence.need.latent import as_row, latent_dependence
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.tables import write_table
from genpolicy.policies.fixtures import FIXTURES, fixture_observations, fixture_rows
from genpolicy.policies.matched_training import (
    PolicySettings,
    matched_configuration,
    seed_folders,
    train_fleet,
    training_windows,
)
from genpolicy.policies.offline import masked_errors
from genpolicy.policies.policy import NetworkPolicy, NoiseName, load_policy
from genpolicy.policies.settings import SamplerConfig
from genpolicy.tasks.api import load_task

Rows = list[dict[str, Any]]

SPLITS = ("validation", "test")
DEFAULT_CONVENTION = "default"


class LatentTest(Settings):
    """What is asked of a latent: whether its samples depend on the observation.

    Attributes:
        method: Method with a latent.
        convention: The convention of `conventions` that draws it.
        samples: Latents, the same at every situation.
        permutations: Permutations of the test.
    """

    method: str
    convention: str
    samples: int
    permutations: int


@dataclass(frozen=True)
class Study:
    """Everything a study needs besides its folders.

    Attributes:
        task: Registered name of the task.
        samplers: Sampler of each method.
        conventions: Further samplers to count modes with, by method and name.
        settings: What the methods share.
        horizons: Common horizons.
        feasibility: Thresholds of the six layers.
        latent: Method whose latent is tested; None tests none.
        samples: Candidates per situation.
        fixtures: Observations whose samples must be reproduced after reload.
        root_seed: Root seed.
        device: Torch device of training.
        workers: Local processes.
        scheduler: `local` or the address of a Dask scheduler.
    """

    task: str
    samplers: Mapping[str, SamplerConfig]
    conventions: Mapping[str, Mapping[str, SamplerConfig]]
    settings: PolicySettings
    horizons: HorizonConfig
    feasibility: FeasibilitySettings
    latent: LatentTest | None
    samples: int
    fixtures: int
    root_seed: int
    device: str
    workers: int
    scheduler: str


@dataclass(frozen=True)
class Evaluation:
    """One trained method and seed, to be measured by one process."""

    study: Study
    method: str
    seed: int
    folder: Path
    sha256: str
    dataset: Path
    audit: Path


def run_study(
    study: Study,
    *,
    dataset: Path,
    audit: Path,
    folder: Path,
    reference: Path | None = None,
    reference_method: str = "chunked_bc",
) -> None:
    """Train and measure every method; write checkpoints, errors, modes and the config differ.

    Args:
        study: What to do.
        dataset: Folder of the dataset.
        audit: Folder of the audit, which names the situations with several modes.
        folder: Existing folder to write into.
        reference: Checkpoint folder that configurations are held against; the reference
            method's own where None.
        reference_method: The method of that checkpoint.
    """
    trained = train_fleet(
        dataset=dataset,
        folder=folder,
        samplers=study.samplers,
        settings=study.settings,
        horizons=study.horizons,
        root_seed=study.root_seed,
        device=study.device,
        workers=study.workers,
        scheduler=study.scheduler,
    )
    jobs = [
        Evaluation(
            study=study,
            method=method,
            seed=seed,
            folder=folder / method / f"seed_{seed}",
            sha256=sha256,
            dataset=dataset,
            audit=audit,
        )
        for method, seeds in trained.items()
        for seed, sha256 in seeds.items()
    ]
    parts = map_shards(evaluate, jobs, workers=study.workers, scheduler=study.scheduler)
    offline = [row for part in parts for row in part[0]]
    modes = [row for part in parts for row in part[1]]
    fixtures = [row for part in parts for row in part[2]]
    write_table(folder / "offline.parquet", pa.Table.from_pylist(offline, OFFLINE))
    write_table(folder / "modes.parquet", pa.Table.from_pylist(modes, MODES))
    write_table(folder / "fixtures.parquet", pa.Table.from_pylist(fixtures, FIXTURES))
    if study.latent is not None:
        found = [row for part in parts for row in part[3]]
        write_bytes(folder / "latent.json", canonical_json(found))
    folders = seed_folders(folder, list(study.samplers), study.settings.seeds[0])
    if reference is not None:
        folders = {reference_method: reference, **folders}
    matched = matched_configuration(folders, reference=reference_method)
    write_bytes(folder / "matched.json", canonical_json(matched))


def evaluate(job: Evaluation) -> tuple[Rows, Rows, Rows, Rows]:
    """Rows of `offline`, `modes` and `fixtures.parquet` and of `latent.json` of one checkpoint."""
    data = load_dataset(job.dataset)
    policy = load_policy(job.folder, expected_sha256=job.sha256)
    observations = fixture_observations(data, horizons=job.study.horizons, count=job.study.fixtures)
    fixtures = fixture_rows(policy, observations, method=job.method, seed=job.seed)
    return (
        offline_rows(job, data, policy),
        mode_rows(job, data, policy),
        fixtures,
        latent_rows(job, data, policy),
    )


def offline_rows(job: Evaluation, data: Dataset, policy: NetworkPolicy) -> list[dict[str, Any]]:
    """Errors of one checkpoint on the held-out splits, by phase."""
    rows = []
    horizons = job.study.horizons
    for split in SPLITS:
        cut = data.windows(
            split,
            observation_horizon=horizons.observation_horizon,
            prediction_horizon=horizons.prediction_horizon,
        )
        uuids = data.episodes["episode_uuid"].to_numpy()
        starts = data.frames.episode.searchsorted(cut.episode)
        names: list[NoiseName] = [
            ("offline", str(uuids[e]), int(i)) for e, i in zip(cut.episode, cut.index, strict=True)
        ]
        errors = masked_errors(
            policy,
            training_windows(data, split, horizons),
            phases=data.frames.phase[starts + cut.index],
            normalisation=data.normalisation,
            noise_names=names,
        )
        rows += [
            {"method": job.method, "seed": job.seed, "split": split, **asdict(error)}
            for error in errors
        ]
    return rows


def mode_rows(job: Evaluation, data: Dataset, policy: NetworkPolicy) -> list[dict[str, Any]]:
    """Modes that one checkpoint reaches, under each sampling convention."""
    study = job.study
    task = load_task(study.task)
    checker = make_checker(task, study.feasibility)
    held_out = held_out_situations(job.audit, data, horizons=study.horizons)
    conventions: dict[str, SamplerConfig] = {DEFAULT_CONVENTION: policy.sampler}
    conventions |= study.conventions.get(job.method, {})
    rows = []
    for convention, sampler in conventions.items():
        rows += modes_of_policy(
            NetworkPolicy(policy.checkpoint, sampler=sampler),
            held_out,
            seed=job.seed,
            convention=sampler.name if convention == DEFAULT_CONVENTION else convention,
            samples=study.samples,
            task=task,
            checker=checker,
        )
    return rows


def latent_rows(job: Evaluation, data: Dataset, policy: NetworkPolicy) -> list[dict[str, Any]]:
    """Whether the tested method's latent depends on the observation; nothing for the others."""
    test = job.study.latent
    held_out = held_out_situations(job.audit, data, horizons=job.study.horizons)
    if test is None or test.method != job.method or len(held_out.situations) < 2:
        return []
    sampler = job.study.conventions[test.method][test.convention]
    found = latent_dependence(
        NetworkPolicy(policy.checkpoint, sampler=sampler),
        held_out,
        samples=test.samples,
        permutations=test.permutations,
        root_seed=job.study.root_seed,
    )
    return [as_row(found, method=job.method, convention=test.convention, seed=job.seed)]


OFFLINE = pa.schema(
    [
        ("method", pa.string()), ("seed", pa.int64()), ("split", pa.string()),
        ("phase", pa.string()), ("windows", pa.int64()), ("masked_mae", pa.float64()),
        ("position_rmse_m", pa.float64()),
    ]
)  # fmt: skip
MODES = pa.schema(
    [
        ("method", pa.string()), ("seed", pa.int64()), ("convention", pa.string()),
        ("episode_uuid", pa.string()), ("index", pa.int64()), ("samples", pa.int64()),
        ("modes_present", pa.int64()), ("modes_covered", pa.int64()),
        ("between_modes", pa.int64()), ("admissible", pa.int64()), ("nfe", pa.int64()),
        ("spread_m", pa.float64()),
    ]
)  # fmt: skip
