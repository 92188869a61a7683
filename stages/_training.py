"""Sections that say what is trained, read by the stages that train and by those that measure."""

from collections.abc import Mapping

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.policies.matched_training import PolicySettings, TrainingPlan
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.variants import Variant
from stages._stage import ARTIFACTS, Params


class MethodsSection(Settings):
    """Section `train_baselines` or `train_generators`.

    Attributes:
        samplers: Methods, and the sampler of each.
    """

    samplers: dict[str, SamplerConfig] = Field(min_length=1)


class FactorsSection(Settings):
    """Section `train_factors`.

    Attributes:
        updates: Training updates of every variant, the reference among them.
        variants: Variants by name.
    """

    updates: int = Field(ge=1)
    variants: dict[str, Variant]


def training_plan(
    params: Params, *, updates: int | None = None, followed: Mapping[str, str] | None = None
) -> TrainingPlan:
    """What all trainings share; `updates` shortens them, `followed` is the mode of each episode."""
    settings = params.section("policy", PolicySettings)
    if updates is not None:
        changed = {"updates": updates, "validation_every": updates}
        training = settings.training.model_copy(update=changed)
        settings = settings.model_copy(update={"training": training})
    return TrainingPlan(
        dataset=ARTIFACTS / "ingest",
        settings=settings,
        horizons=params.horizons,
        root_seed=params.seed,
        device=params.compute.device,
        workers=params.compute.workers,
        scheduler=params.compute.scheduler,
        followed=followed,
    )
