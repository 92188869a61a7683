"""Variants of one reference policy, each with one factor changed; trained alike.

After Haldar et al., arXiv 2406.07539: representation, trunk, head and temporal design are each
changed alone, with the same number of updates on the same windows, so that no head is credited
for an encoder.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from genpolicy.compute import map_shards
from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import ConfigError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.policies.checkpoint import CONFIG_FILE
from genpolicy.policies.matched_training import (
    SINGLE_ACTION_KEYS,
    TrainingJob,
    TrainingPlan,
    differing_keys,
    train_job,
)
from genpolicy.policies.settings import SamplerConfig

Factor = Literal["reference", "representation", "trunk", "head", "temporal"]

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
        sampler: Its sampler; None: that of the baseline of the same method.
        encoder: Encoder of the network.
        trunk: Trunk of the network.
        observation_horizon: H_o, where it differs from the common one.
    """

    factor: Factor
    method: str = "chunked_bc"
    sampler: SamplerConfig | None = None
    encoder: Literal["mlp", "linear"] = "mlp"
    trunk: Literal["mlp", "transformer"] = "mlp"
    observation_horizon: int | None = None


def resolved(
    variants: Mapping[str, Variant], samplers: Mapping[str, SamplerConfig]
) -> dict[str, tuple[Variant, SamplerConfig]]:
    """Every variant with its sampler.

    Args:
        variants: Variants by name.
        samplers: Samplers of the baselines, by method.

    Raises:
        ConfigError: A variant names no sampler, and no baseline has its method.
    """
    result = {}
    for name, variant in variants.items():
        sampler = variant.sampler or samplers.get(variant.method)
        if sampler is None:
            raise ConfigError(
                where=f"train_factors.variants.{name}",
                found=f"without a sampler, and no baseline is {variant.method}",
                expected="a sampler",
                action="Give the variant one.",
            )
        result[name] = (variant, sampler)
    return result


def reference_of(variants: Mapping[str, Variant]) -> str:
    """Name of the variant that the others are changes of.

    Raises:
        ConfigError: Not exactly one.
    """
    names = [name for name, variant in variants.items() if variant.factor == "reference"]
    if len(names) != 1:
        raise ConfigError(
            where="train_factors.variants",
            found=f"{len(names)} references",
            expected="exactly one",
            action="Mark the variant that the others are changes of.",
        )
    return names[0]


def train_variants(
    plan: TrainingPlan,
    variants: Mapping[str, Variant],
    samplers: Mapping[str, SamplerConfig],
    *,
    folder: Path,
) -> None:
    """Train all variants with every seed; write the checkpoints and `variants.json`.

    Args:
        plan: What all share.
        variants: Variants by name, exactly one of them the reference.
        samplers: Samplers of the baselines, by method.
        folder: Existing folder; checkpoints go into `<variant>/seed_<n>`.

    Raises:
        ConfigError: Not exactly one reference, or a variant without a sampler.
    """
    reference = reference_of(variants)
    data = load_dataset(plan.dataset)
    network = plan.settings.network
    jobs = [
        TrainingJob(
            dataset=plan.dataset,
            folder=folder / name / f"seed_{seed}",
            request=plan.request(
                data,
                method=variant.method,
                sampler=sampler,
                seed=seed,
                network=network.model_copy(
                    update={"encoder": variant.encoder, "trunk": variant.trunk}
                ),
                observation_horizon=variant.observation_horizon,
            ),
            device=plan.device,
            seed=seed,
            fixtures=0,
        )
        for seed in plan.settings.seeds
        for name, (variant, sampler) in resolved(variants, samplers).items()
    ]
    map_shards(train_job, jobs, workers=plan.workers, scheduler=plan.scheduler)
    configs = {
        name: read_json(folder / name / f"seed_{plan.settings.seeds[0]}" / CONFIG_FILE)
        for name in variants
    }
    document = isolation(variants, configs, reference) | {"updates": plan.settings.training.updates}
    write_bytes(folder / "variants.json", canonical_json(document))


def isolation(
    variants: Mapping[str, Variant], configs: Mapping[str, Mapping[str, Any]], reference: str
) -> dict[str, Any]:
    """What every variant changes against the reference, and what its factor may change."""
    return {
        "reference": reference,
        "variants": {
            name: {
                "factor": variant.factor,
                "method": variant.method,
                "parameters": configs[name]["parameters"],
                "changed": differing_keys(configs[reference], configs[name]),
                "allowed": list(FACTOR_KEYS[variant.factor]),
                "prediction_horizon": configs[name]["horizons"]["prediction_horizon"],
            }
            for name, variant in variants.items()
        },
    }
