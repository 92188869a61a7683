"""Training of several methods and seeds on one dataset, and how they differ.

All methods get the same windows, the same encoder and trunk, the same optimisation. What may
differ is named (`ALLOWED_DIFFERENCES`); every other difference is listed for the gate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from genpolicy.compute import map_shards
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.integrity.documents import read_json
from genpolicy.policies.checkpoint import CONFIG_FILE, Provenance
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig
from genpolicy.policies.training import TrainingRequest, train
from genpolicy.policies.windows import Windows
from genpolicy.seeds import integer_seed

ALLOWED_DIFFERENCES = (
    "method", "sampler.name", "sampler.steps", "sampler.clip", "sampler.population",
    "training_seed",
)  # fmt: skip
DERIVED = ("weights_sha256", "parameters", "training_only_parameters", "flops")


class PolicySettings(Settings):
    """Section `policy`: what every method shares.

    Attributes:
        network: Sizes of encoder, trunk and head.
        head: Head settings.
        training: Optimisation.
        seeds: Training seeds, by number.
    """

    network: NetworkConfig
    head: HeadConfig
    training: TrainingConfig
    seeds: list[int]


@dataclass(frozen=True)
class TrainingJob:
    """One method and seed, for one process.

    Attributes:
        dataset: Folder of the ingested dataset.
        folder: Checkpoint folder to write.
        request: What decides the checkpoint's bytes.
        device: Torch device.
    """

    dataset: Path
    folder: Path
    request: TrainingRequest
    device: str


def train_fleet(
    *,
    dataset: Path,
    folder: Path,
    samplers: Mapping[str, SamplerConfig],
    settings: PolicySettings,
    horizons: HorizonConfig,
    root_seed: int,
    device: str,
    workers: int,
    scheduler: str,
) -> dict[str, dict[int, str]]:
    """Train every method of `samplers` with every seed into `folder/<method>/seed_<n>`.

    Returns:
        SHA-256 of the checkpoint by method and seed.
    """
    data = load_dataset(dataset)
    provenance = Provenance(
        dataset_manifest_sha256=data.manifest_sha256,
        action_contract_sha256=data.manifest["action_contract"]["sha256"],
        observation_contract_sha256=data.manifest["observation_contract"]["sha256"],
    )
    jobs = [
        TrainingJob(
            dataset=dataset,
            folder=folder / method / f"seed_{seed}",
            request=TrainingRequest(
                method=method,
                horizons=horizons,
                normalisation=data.normalisation,
                network=settings.network,
                head=settings.head,
                training=settings.training,
                sampler=sampler,
                provenance=provenance,
                seed=integer_seed(root_seed, "training", seed),
            ),
            device=device,
        )
        for method, sampler in samplers.items()
        for seed in settings.seeds
    ]
    hashes = map_shards(train_job, jobs, workers=workers, scheduler=scheduler)
    result: dict[str, dict[int, str]] = {}
    keys = [(method, seed) for method in samplers for seed in settings.seeds]
    for (method, seed), digest in zip(keys, hashes, strict=True):
        result.setdefault(method, {})[seed] = digest
    return result


def train_job(job: TrainingJob) -> str:
    """Train one checkpoint; returns its SHA-256."""
    data = load_dataset(job.dataset)
    job.folder.parent.mkdir(parents=True, exist_ok=True)
    return train(
        job.folder,
        job.request,
        windows=training_windows(data, "train", job.request.horizons),
        validation=training_windows(data, "validation", job.request.horizons),
        device=job.device,
    )


def training_windows(data: Dataset, split: str, horizons: HorizonConfig) -> Windows:
    """Windows of the successful episodes of a split."""
    cut = data.windows(
        split,
        observation_horizon=horizons.observation_horizon,
        prediction_horizon=horizons.prediction_horizon,
    )
    return Windows(cut.observations, cut.actions, cut.is_pad)


def matched_configuration(folders: Mapping[str, Path], *, reference: str) -> dict[str, Any]:
    """How the configurations of trained methods differ from that of `reference`.

    Args:
        folders: One checkpoint folder per method, the reference among them.
        reference: The method that the others are held against.

    Returns:
        Content of `matched.json`: parameters and FLOPs per part, differing keys, whitelist.
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
        skip = SINGLE_ACTION_KEYS if config["horizons"]["prediction_horizon"] == 1 else ()
        changed = differing_keys(configs[reference], config)
        differing[method] = [key for key in changed if key not in skip]
    return {
        "reference": reference,
        "methods": methods,
        "differing_keys": differing,
        "whitelist": list(ALLOWED_DIFFERENCES),
        "single_action_keys": list(SINGLE_ACTION_KEYS),
    }


SINGLE_ACTION_KEYS = (
    "horizons.prediction_horizon", "horizons.execution_horizon", "dimensions.prediction_horizon",
)  # fmt: skip


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
