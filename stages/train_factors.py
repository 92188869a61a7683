"""Stage `train_factors`: representation, trunk, head and temporal design, each changed alone."""

from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.variants import train_variants
from stages._contracts import require_one_contract
from stages._stage import ARTIFACTS, Params, main
from stages._training import FactorsSection, MethodsSection, training_plan


def work(params: Params) -> None:
    """Train every variant."""
    require_one_contract()
    section = params.section("train_factors", FactorsSection)
    samplers = params.section("train_baselines", MethodsSection).samplers
    plan = training_plan(params, updates=section.updates)
    with output_folder(ARTIFACTS / "train_factors") as folder:
        train_variants(plan, section.variants, samplers, folder=folder)


if __name__ == "__main__":
    main("train_factors", work)
