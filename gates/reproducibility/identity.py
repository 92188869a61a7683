"""The identity card of a candidate: is each item recorded, and is it what the checkpoint says?"""

import dataclasses
from collections.abc import Mapping
from typing import Any

from genpolicy.evidence.documents.given import TrainedConfig
from genpolicy.evidence.documents.reproducibility import IdentityCard

MAY_BE_NONE = ("eta", "tolerance")
"""Of samplers that have none."""
NEEDS = {"eta": ("ddim",), "tolerance": ("bosh3",)}
"""Samplers that are another one without it."""


def unrecorded(card: IdentityCard) -> list[str]:
    """Items of the card that say nothing, by name."""
    items = {item.name: getattr(card, item.name) for item in dataclasses.fields(card)}
    empty = [name for name, value in items.items() if name not in MAY_BE_NONE and not value]
    return empty + [
        name for name, samplers in NEEDS.items() if card.sampler in samplers and items[name] is None
    ]


def contradicted(card: IdentityCard, config: TrainedConfig) -> list[str]:
    """Items in which the card and the checkpoint's own configuration differ, with both values."""
    own = _as_trained(config)
    said = {name: getattr(card, name) for name in own}
    return [
        f"{name}: {said[name]}, trained as {own[name]}" for name in own if said[name] != own[name]
    ]


def _as_trained(config: TrainedConfig) -> Mapping[str, Any]:
    horizons, sampler, rests_on = config.horizons, config.sampler, config.provenance
    return {
        "parameters": config.parameters.get("total"),
        "training_seeds": [str(config.training_seed)],
        "dataset": rests_on.get("dataset_manifest_sha256"),
        "action_semantics": rests_on.get("action_contract_sha256"),
        "observation_semantics": rests_on.get("observation_contract_sha256"),
        "observation_horizon": horizons.get("observation_horizon"),
        "prediction_horizon": horizons.get("prediction_horizon"),
        "execution_horizon": horizons.get("execution_horizon"),
        "sampler": sampler.get("name"),
        "sampler_steps": sampler.get("steps"),
        "batch_rows": sampler.get("batch_rows"),
    }
