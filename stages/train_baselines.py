"""Stage `train_baselines`: the simpler policies, trained under one configuration."""

from genpolicy.audit.followed_rows import Demonstration
from genpolicy.integrity.atomic import output_folder
from genpolicy.integrity.rows import read_rows
from genpolicy.policies.matched_training import train_matched
from stages._contracts import require_one_contract
from stages._stage import ARTIFACTS, Params, main
from stages._training import MethodsSection, training_plan


def work(params: Params) -> None:
    """Train every baseline."""
    require_one_contract()
    section = params.section("train_baselines", MethodsSection)
    rows = read_rows(ARTIFACTS / "audit" / "demonstrated.parquet", Demonstration)
    followed = {row.episode_uuid: row.mode for row in rows}
    with output_folder(ARTIFACTS / "train_baselines") as folder:
        train_matched(training_plan(params, followed=followed), section.samplers, folder=folder)


if __name__ == "__main__":
    main("train_baselines", work)
