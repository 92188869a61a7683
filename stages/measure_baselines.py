"""Stage `measure_baselines`: what the simpler policies reach on held-out data."""

from genpolicy.candidates.judged import trained
from genpolicy.evidence.need.baselines import BaselinePlan, write_baselines
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import PolicySettings
from stages._contracts import require_one_contract
from stages._measuring import MeasureBaselinesSection
from stages._stage import ARTIFACTS, Params, main
from stages._training import MethodsSection


def work(params: Params) -> None:
    """Measure errors, modes and the latent of every baseline."""
    require_one_contract("train_baselines")
    section = params.section("measure_baselines", MeasureBaselinesSection)
    names = params.section("train_baselines", MethodsSection).samplers
    plan = BaselinePlan(
        task=params.task.name,
        dataset=ARTIFACTS / "ingest",
        audit=ARTIFACTS / "audit",
        horizons=params.horizons,
        feasibility=params.section("feasibility", FeasibilitySettings),
        conventions=section.conventions,
        samples=section.samples,
        latent=section.latent,
        root_seed=params.seed,
    )
    seeds = params.section("policy", PolicySettings).seeds
    folder_of, device = ARTIFACTS / "train_baselines", params.compute.device
    baselines = trained(folder_of, names, seeds=seeds, device=device)
    with output_folder(ARTIFACTS / "measure_baselines") as folder:
        write_baselines(
            plan,
            baselines,
            folder,
            workers=params.compute.workers,
            scheduler=params.compute.scheduler,
        )


if __name__ == "__main__":
    main("measure_baselines", work)
