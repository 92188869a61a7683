"""Stage `measure_factors`: what each variant changes on the same held-out rows and situations."""

from pydantic import Field

from genpolicy.candidates.judged import trained
from genpolicy.contract.settings import Settings
from genpolicy.evidence.need.factors import FactorPlan, write_factors
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import PolicySettings
from stages._confidence import confidence_of
from stages._contracts import require_one_contract
from stages._measuring import MeasureBaselinesSection
from stages._stage import ARTIFACTS, Params, main
from stages._training import FactorsSection, MethodsSection


class MeasureFactorsSection(Settings):
    """Section `measure_factors`.

    Attributes:
        samples: Candidates per held-out situation of a convention that draws.
        stride: Every so many held-out windows are compared.
    """

    samples: int = Field(ge=1)
    stride: int = Field(ge=1)


def work(params: Params) -> None:
    """Measure every variant."""
    require_one_contract("train_factors")
    section = params.section("measure_factors", MeasureFactorsSection)
    variants = params.section("train_factors", FactorsSection).variants
    plan = FactorPlan(
        task=params.task.name,
        dataset=ARTIFACTS / "ingest",
        audit=ARTIFACTS / "audit",
        horizons=params.horizons,
        feasibility=params.section("feasibility", FeasibilitySettings),
        variants=variants,
        samplers=params.section("train_baselines", MethodsSection).samplers,
        conventions=params.section("measure_baselines", MeasureBaselinesSection).conventions,
        samples=section.samples,
        stride=section.stride,
        confidence=confidence_of(params),
    )
    seeds = params.section("policy", PolicySettings).seeds
    folder_of, device = ARTIFACTS / "train_factors", params.compute.device
    checkpoints = trained(folder_of, variants, seeds=seeds, device=device)
    with output_folder(ARTIFACTS / "measure_factors") as folder:
        write_factors(
            plan,
            checkpoints,
            folder,
            workers=params.compute.workers,
            scheduler=params.compute.scheduler,
        )


if __name__ == "__main__":
    main("measure_factors", work)
