"""Stage `factors`: representation, trunk, head and temporal design, each changed alone."""

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.evidence.need.factors import FactorStudy, Variant, run_factors
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import PolicySettings
from stages._stage import ARTIFACTS, Params, main


class FactorsSection(Settings):
    """Section `factors`.

    Attributes:
        steps: Training updates of every variant, the reference among them.
        seeds: Training seeds, by number.
        samples: Candidates per held-out situation of a convention that draws.
        stride: Every so many held-out windows are compared.
        variants: Variants by name.
    """

    steps: int = Field(ge=1)
    seeds: list[int] = Field(min_length=1)
    samples: int = Field(ge=1)
    stride: int = Field(ge=1)
    variants: dict[str, Variant]


def work(params: Params) -> None:
    """Train and measure every variant."""
    section = params.section("factors", FactorsSection)
    shared = params.section("policy", PolicySettings)
    training = shared.training.model_copy(
        update={"steps": section.steps, "validation_every": section.steps}
    )
    study = FactorStudy(
        task=params.task.name,
        variants=section.variants,
        settings=shared.model_copy(update={"training": training, "seeds": section.seeds}),
        horizons=params.horizons,
        feasibility=params.section("feasibility", FeasibilitySettings),
        samples=section.samples,
        stride=section.stride,
        root_seed=params.seed,
        device=params.compute.device,
        workers=params.compute.workers,
        scheduler=params.compute.scheduler,
    )
    with output_folder(ARTIFACTS / "factors") as folder:
        run_factors(study, dataset=ARTIFACTS / "ingest", audit=ARTIFACTS / "audit", folder=folder)


if __name__ == "__main__":
    main("factors", work)
