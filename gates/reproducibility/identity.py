"""The identity card of a candidate: is each item recorded, and is it what the checkpoint says?"""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from gates.reproducibility.settings import ReproducibilitySettings
from gates.words import HASH
from genpolicy.evidence.documents.given import TrainedConfig
from genpolicy.evidence.documents.reproducibility import CandidateIdentity, IdentityCard

MAY_BE_NONE = ("eta", "tolerance")
"""Of samplers that have none."""
NEEDS = {"eta": ("ddim",), "tolerance": ("bosh3",)}
"""Samplers that are another one without it."""


ALWAYS_THE_SAME = ("direct", "z_zero")
"""Samplers of which an invocation draws one candidate, as all would be equal."""
WARM_UP, THREADS = 10, 1
"""Invocations before the first that is timed as warm; threads of what is trained here."""


def says_nothing(value: object) -> bool:
    """Whether an item is left blank: no text but spaces, and no number above zero."""
    if isinstance(value, str):
        return not value.strip()
    if isinstance(value, list):
        return not value or any(isinstance(one, str) and not one.strip() for one in value)
    return not (isinstance(value, int | float) and 0.0 < value < math.inf)


def unrecorded(card: IdentityCard) -> list[str]:
    """Items of the card that say nothing, by name."""
    items = {item.name: getattr(card, item.name) for item in dataclasses.fields(card)}
    empty = [
        name for name, value in items.items() if name not in MAY_BE_NONE and says_nothing(value)
    ]
    if not says_nothing(card.selector_sha256) and not HASH.fullmatch(card.selector_sha256):
        empty.append("selector_sha256")
    return empty + [
        name for name, samplers in NEEDS.items() if card.sampler in samplers and items[name] is None
    ]


def contradicted(
    entry: CandidateIdentity, config: TrainedConfig, *, split: str, evaluations: str
) -> list[str]:
    """Items in which the card and the checkpoint's own configuration differ, with both values.

    Args:
        entry: The candidate, with its card.
        config: Configuration of the first training seed, which is the one that is promoted.
        split: Which episodes trained it, by hash.
        evaluations: Network evaluations that were allowed where they were counted.
    """
    card, own = entry.card, dict(_as_trained(config))
    own |= {"split": split, "evaluations": evaluations}
    for name in MAY_BE_NONE:
        if getattr(card, name) is not None:
            own[name] = config.sampler.get(name)
    own["training_seeds"] = [str(seed) for seed in entry.seed]
    said = {name: getattr(card, name) for name in own}
    found = [
        f"{name}: {said[name]}, trained as {own[name]}" for name in own if said[name] != own[name]
    ]
    if entry.seed[:1] != [config.training_seed] or len(entry.seed) != len(entry.checkpoints):
        found.append(f"seed: {entry.seed}, trained as {config.training_seed} first")
    return found


def unplanned(
    card: IdentityCard, settings: ReproducibilitySettings, *, draws: str | bool | None
) -> list[str]:
    """Items of the card that are another value than the plan and the regime give, with both.

    Args:
        card: The card.
        settings: The plan.
        draws: Name of its sampler, or whether its samples differ.
    """
    several = draws if isinstance(draws, bool) else draws not in ALWAYS_THE_SAME
    own = {
        "deadline_s": settings.deadline_s,
        "candidates": settings.invocation_candidates if several else 1,
        "warm_up": WARM_UP,
        # Asked again when so many actions are left, and once in a period at most.
        "invocation_rate_hz": card.control_rate_hz
        / max(1, card.execution_horizon - settings.replan_lead_rows),
    }
    if not isinstance(draws, bool):  # another process has the threads that its maker says
        own["threads"] = THREADS
    return [
        f"{name}: {getattr(card, name)}, planned {value}"
        for name, value in own.items()
        if not says_nothing(getattr(card, name)) and getattr(card, name) != value
    ]


def _as_trained(config: TrainedConfig) -> Mapping[str, Any]:
    horizons, sampler, rests_on = config.horizons, config.sampler, config.provenance
    period_s = float(horizons.get("action_period_s", math.inf))
    return {
        "parameters": config.parameters.get("total"),
        "dataset": rests_on.get("dataset_manifest_sha256"),
        "action_semantics": rests_on.get("action_contract_sha256"),
        "observation_semantics": rests_on.get("observation_contract_sha256"),
        "observation_horizon": horizons.get("observation_horizon"),
        "prediction_horizon": horizons.get("prediction_horizon"),
        "execution_horizon": horizons.get("execution_horizon"),
        "control_rate_hz": 1.0 / period_s,
        "sampler": sampler.get("name"),
        "sampler_steps": sampler.get("steps"),
        "batch_rows": sampler.get("batch_rows"),
    }
