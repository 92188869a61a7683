"""Stage `train_generators`: the candidates, on the network and budget of the baselines."""

from dataclasses import replace
from pathlib import Path

from gates.proof import admit
from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import train_matched
from stages._contracts import require_one_contract
from stages._stage import ARTIFACTS, Params, main
from stages._training import MethodsSection, training_plan


def work(params: Params) -> None:
    """Admit through gate A, then train every candidate."""
    admit("train_generators", Path.cwd())
    require_one_contract("train_baselines")
    section = params.section("train_generators", MethodsSection)
    plan = replace(training_plan(params), keep_earlier=True)
    reference = ARTIFACTS / "train_baselines" / "chunked_bc" / f"seed_{plan.settings.seeds[0]}"
    with output_folder(ARTIFACTS / "train_generators") as folder:
        train_matched(plan, section.samplers, folder=folder, reference=reference)


if __name__ == "__main__":
    main("train_generators", work)
