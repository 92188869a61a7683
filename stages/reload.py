"""Stage `reload`: every candidate comes back in a fresh process; spread and modes against NFE."""

from pathlib import Path

from pydantic import Field

from gates.admission import admit
from genpolicy.contract.settings import Settings
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.reproducibility.reload import ReloadPlan, write_reload
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.tasks.api import load_task
from stages._stage import ARTIFACTS, Params, main
from stages._study import StudySection


class ReloadSection(Settings):
    """Section `reload`.

    Attributes:
        sweep: Sampler steps to try besides the chosen ones, by method.
        samples: Candidates per situation.
    """

    sweep: dict[str, list[int]]
    samples: int = Field(ge=2)


def work(params: Params) -> None:
    """Admit through gate A, then reload, compare, sweep."""
    admit("reload", Path.cwd())
    section = params.section("reload", ReloadSection)
    generators = params.section("generators", StudySection)
    task = load_task(params.task.name)
    with output_folder(ARTIFACTS / "reload") as folder:
        plan = ReloadPlan(
            checkpoints=ARTIFACTS / "generators",
            dataset=ARTIFACTS / "ingest",
            audit=ARTIFACTS / "audit",
            methods=list(generators.samplers),
            seeds=params.section("policy", PolicySettings).seeds,
            fixtures=generators.fixtures,
            sweep=section.sweep,
            samples=section.samples,
            horizons=params.horizons,
        )
        checker = make_checker(task, params.section("feasibility", FeasibilitySettings))
        write_reload(plan, folder, task=task, checker=checker)


if __name__ == "__main__":
    main("reload", work)
