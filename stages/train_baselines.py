"""Stage `train_baselines`: the simpler policies, trained under one configuration."""

from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import train_matched
from stages._stage import ARTIFACTS, Params, main
from stages._training import MethodsSection, training_plan


def work(params: Params) -> None:
    """Train every baseline."""
    section = params.section("train_baselines", MethodsSection)
    with output_folder(ARTIFACTS / "train_baselines") as folder:
        plan = training_plan(params, demonstrated=ARTIFACTS / "audit" / "demonstrated.parquet")
        train_matched(plan, section.samplers, folder=folder)


if __name__ == "__main__":
    main("train_baselines", work)
