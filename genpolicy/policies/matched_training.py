"""Training of several methods and seeds on one dataset, and how they differ.

All methods get the same windows, the same encoder and trunk, the same optimisation. Every setting
in which they differ is listed for the gates, who know what may. A method that is defined by its
demonstrations (those of one mode) gets fewer windows and as many updates.
Each checkpoint leaves fixtures: samples that it must give again after reload.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from genpolicy.compute import map_shards
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.errors import ConfigError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.integrity.rows import write_rows
from genpolicy.policies.checkpoint import CONFIG_FILE, Provenance
from genpolicy.policies.demonstrations import episodes_of_one_mode, phase_columns
from genpolicy.policies.fixtures import FixtureRow, fixture_observations, fixture_rows
from genpolicy.policies.methods import method_named
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig
from genpolicy.policies.sources import source_folder
from genpolicy.policies.training import train
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.windows import Windows
from genpolicy.seeds import integer_seed

DERIVED = ("weights_sha256", "parameters", "training_only_parameters", "flops", "distilled")


class PolicySettings(Settings):
    """Section `policy`: what every method shares.

    Attributes:
        network: Sizes of encoder, trunk and head.
        head: Head settings.
        training: Optimisation.
        seeds: Training seeds, by number; the first is the one that is promoted.
        fixtures: Observations whose samples must be reproduced after reload.
    """

    network: NetworkConfig = NetworkConfig()
    head: HeadConfig = HeadConfig()
    training: TrainingConfig = TrainingConfig()
    seeds: list[int] = Field(min_length=1)
    fixtures: int = Field(ge=1)


@dataclass(frozen=True)
class TrainingPlan:
    """What all trainings of a stage share.

    Attributes:
        dataset: Folder of the ingested dataset.
        settings: What the methods share.
        horizons: Common horizons.
        root_seed: Root seed.
        device: Torch device.
        workers: Local processes.
        scheduler: `local` or the address of a Dask scheduler.
        followed: Mode that each episode followed, as the audit saw it; None where no method asks.
        keep_earlier: Whether the weights at three quarters of each training are kept too.
    """

    dataset: Path
    settings: PolicySettings
    horizons: HorizonConfig
    root_seed: int
    device: str
    workers: int
    scheduler: str
    followed: Mapping[str, str] | None = None
    keep_earlier: bool = False

    def request(
        self,
        data: Dataset,
        *,
        method: str,
        sampler: SamplerConfig,
        seed: int,
        network: NetworkConfig | None = None,
        observation_horizon: int | None = None,
    ) -> TrainingRequest:
        """One training; network and observation horizon are the common ones where None."""
        chosen = self.episodes(data, method)
        seen = observation_horizon or self.horizons.observation_horizon
        return TrainingRequest(
            method=method,
            horizons=self.horizons.model_copy(update={"observation_horizon": seen}),
            normalisation=data.normalisation,
            network=network or self.settings.network,
            head=self.settings.head,
            training=self.settings.training,
            sampler=sampler,
            provenance=Provenance(
                dataset_manifest_sha256=data.manifest_sha256,
                action_contract_sha256=data.manifest["action_contract"]["sha256"],
                observation_contract_sha256=data.manifest["observation_contract"]["sha256"],
                episodes_sha256=None if chosen is None else sha256_bytes(canonical_json(chosen)),
            ),
            seed=integer_seed(self.root_seed, "training", seed),
            phase_columns=phase_columns(data),
            keep_earlier=self.keep_earlier,
        )

    def episodes(self, data: Dataset, method: str) -> list[str] | None:
        """Episodes that a method is trained on; None: all of the training split.

        Raises:
            ConfigError: It asks for those of one mode, and no audit says which.
        """
        if not method_named(method).one_mode:
            return None
        if self.followed is None:
            raise ConfigError(
                where=f"training of {method}",
                found="no word of the modes that the demonstrations followed",
                expected="the audit's `demonstrated.parquet`",
                action="Train it in the stage `train_baselines`, behind the audit.",
            )
        return episodes_of_one_mode(self.followed, data)


@dataclass(frozen=True)
class TrainingJob:
    """One checkpoint, for one process.

    Attributes:
        dataset: Folder of the ingested dataset.
        folder: Checkpoint folder to write.
        request: What decides the checkpoint's bytes.
        device: Torch device.
        seed: Number of the training seed.
        fixtures: Observations to draw fixtures at; 0 draws none.
        episodes: Episodes to train on; None: all of the training split.
        weights_of: Checkpoint that the method rests on; None where it rests on none.
    """

    dataset: Path
    folder: Path
    request: TrainingRequest
    device: str
    seed: int
    fixtures: int
    episodes: tuple[str, ...] | None = None
    weights_of: Path | None = None


def train_matched(
    plan: TrainingPlan,
    samplers: Mapping[str, SamplerConfig],
    *,
    folder: Path,
    reference: Path | None = None,
    reference_method: str = "chunked_bc",
) -> None:
    """Train every method with every seed; write checkpoints, fixtures and `matched.json`.

    Args:
        plan: What all share.
        samplers: Methods, and the sampler of each.
        folder: Existing folder to write into.
        reference: Checkpoint folder that configurations are held against; the reference
            method's own where None.
        reference_method: The method of that checkpoint.
    """
    _, fixtures = train_methods(plan, samplers, folder=folder)
    write_rows(folder / "fixtures.parquet", FixtureRow, fixtures)
    folders = seed_folders(folder, list(samplers), plan.settings.seeds[0])
    if reference is not None:
        folders = {reference_method: reference, **folders}
    matched = matched_configuration(folders, reference=reference_method)
    write_bytes(folder / "matched.json", canonical_json(matched))


def train_methods(
    plan: TrainingPlan, samplers: Mapping[str, SamplerConfig], *, folder: Path
) -> tuple[dict[str, dict[int, str]], list[FixtureRow]]:
    """Train every method of `samplers` with every seed into `folder/<method>/seed_<n>`.

    Returns:
        SHA-256 of the checkpoint by method and seed, and the fixtures of all of them.
    """
    data = load_dataset(plan.dataset)
    keys = [(method, seed) for method in samplers for seed in plan.settings.seeds]
    jobs = {
        (method, seed): TrainingJob(
            dataset=plan.dataset,
            folder=folder / method / f"seed_{seed}",
            request=plan.request(data, method=method, sampler=samplers[method], seed=seed),
            device=plan.device,
            seed=seed,
            fixtures=plan.settings.fixtures,
            episodes=_tuple(plan.episodes(data, method)),
            weights_of=source_folder(folder, method, samplers, seed),
        )
        for method, seed in keys
    }
    trained: dict[tuple[str, int], tuple[str, list[FixtureRow]]] = {}
    # What rests on another method's weights comes behind it.
    for own in (True, False):
        due = [key for key in keys if (jobs[key].weights_of is None) == own]
        done = map_shards(
            train_job, [jobs[key] for key in due], workers=plan.workers, scheduler=plan.scheduler
        )
        trained |= dict(zip(due, done, strict=True))
    hashes: dict[str, dict[int, str]] = {}
    for method, seed in keys:
        hashes.setdefault(method, {})[seed] = trained[method, seed][0]
    return hashes, [row for key in keys for row in trained[key][1]]


def _tuple(names: list[str] | None) -> tuple[str, ...] | None:
    return None if names is None else tuple(names)


def train_job(job: TrainingJob) -> tuple[str, list[FixtureRow]]:
    """Train one checkpoint; returns its SHA-256 and the fixtures drawn from its files."""
    data = load_dataset(job.dataset)
    horizons = job.request.horizons
    job.folder.parent.mkdir(parents=True, exist_ok=True)
    digest = train(
        job.folder,
        job.request,
        windows=training_windows(data, "train", horizons, episodes=job.episodes),
        validation=training_windows(data, "validation", horizons),
        device=job.device,
        weights_of=job.weights_of,
    )
    if job.fixtures == 0:
        return digest, []
    seen = fixture_observations(data, horizons=horizons, count=job.fixtures)
    policy = load_policy(job.folder, expected_sha256=digest)
    return digest, fixture_rows(policy, seen, method=job.request.method, seed=job.seed)


def training_windows(
    data: Dataset, split: str, horizons: HorizonConfig, *, episodes: Sequence[str] | None = None
) -> Windows:
    """Windows of the successful episodes of a split, or of some of them.

    Raises:
        ContractError: None of `episodes` is a successful one of the split.
    """
    cut = data.windows(
        split,
        observation_horizon=horizons.observation_horizon,
        prediction_horizon=horizons.prediction_horizon,
    )
    uuids = data.episodes["episode_uuid"].to_numpy(dtype=str)
    own = np.ones(len(cut.episode), dtype=bool)
    if episodes is not None:
        own = np.isin(uuids[cut.episode], np.asarray(episodes, dtype=uuids.dtype))
    return Windows(
        cut.observations[own], cut.actions[own], cut.is_pad[own], uuids[cut.episode[own]]
    )


def matched_configuration(folders: Mapping[str, Path], *, reference: str) -> dict[str, Any]:
    """How the configurations of trained methods differ from that of `reference`.

    Args:
        folders: One checkpoint folder per method, the reference among them.
        reference: The method that the others are held against.

    Returns:
        Content of `matched.json`: parameters and FLOPs per part, differing keys.
    """
    configs = {method: read_json(folder / CONFIG_FILE) for method, folder in folders.items()}
    methods, differing = {}, {}
    for method, config in configs.items():
        methods[method] = {
            "parameters": config["parameters"],
            "training_only_parameters": config["training_only_parameters"],
            "flops": config["flops"],
            "config": config,
        }
        # A method that predicts one action differs in its horizon by definition (chapter 1.2).
        skip: tuple[str, ...] = ()
        if config["horizons"]["prediction_horizon"] == 1:
            skip = SINGLE_ACTION_KEYS
        # And one that is trained on the demonstrations of one mode, in these.
        if method_named(config["method"]).one_mode:
            skip = ONE_MODE_KEYS
        changed = differing_keys(configs[reference], config)
        differing[method] = [key for key in changed if key not in skip]
    return {
        "reference": reference,
        "methods": methods,
        "differing_keys": differing,
        "single_action_keys": list(SINGLE_ACTION_KEYS),
        "one_mode_keys": list(ONE_MODE_KEYS),
    }


SINGLE_ACTION_KEYS = (
    "horizons.prediction_horizon", "horizons.execution_horizon", "dimensions.prediction_horizon",
)  # fmt: skip
ONE_MODE_KEYS = ("provenance.episodes_sha256",)


def differing_keys(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Sorted keys in which two checkpoint configurations differ, derived numbers left out."""
    base, flat = _flat(one), _flat(other)
    return sorted(key for key in base.keys() | flat.keys() if base.get(key) != flat.get(key))


def _flat(config: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in config.items():
        if not prefix and key in DERIVED:
            continue
        if isinstance(value, Mapping):
            result |= _flat(value, f"{prefix}{key}.")
        else:
            result[f"{prefix}{key}"] = value
    return result


def seed_folders(root: Path, methods: Sequence[str], seed: int) -> dict[str, Path]:
    """Checkpoint folder of each method for one training seed."""
    return {method: root / method / f"seed_{seed}" for method in methods}
