"""Stage `reload`: every candidate comes back in a fresh process; errors, modes against NFE."""

from pathlib import Path

from pydantic import ConfigDict, Field

from gates.proof import admit
from genpolicy.candidates.brought import BroughtSection, read_brought
from genpolicy.candidates.judged import trained
from genpolicy.contract.settings import Settings
from genpolicy.evidence.reproducibility.identity import Deployment
from genpolicy.evidence.reproducibility.reload import ReloadPlan, write_reload
from genpolicy.evidence.reproducibility.swept import SweepSection
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import PolicySettings
from stages._contracts import require_one_contract
from stages._stage import ARTIFACTS, Params, main
from stages._training import MethodsSection


class Answering(Settings):
    """Of section `execution` only what names a candidate: the rest would reload it again."""

    model_config = ConfigDict(extra="ignore")

    deadline_s: float = Field(gt=0.0)
    replan_lead_rows: int = Field(ge=0)


def work(params: Params) -> None:
    """Admit through gate A, then reload, compare, sweep."""
    admit("reload", Path.cwd())
    require_one_contract("train_generators")
    section = params.section("reload", SweepSection)
    names = params.section("train_generators", MethodsSection).samplers
    seeds = params.section("policy", PolicySettings).seeds
    stress = params.section("stress", StressSettings)
    answering = params.section("execution", Answering)
    plan = ReloadPlan(
        task=params.task.name,
        feasibility=params.section("feasibility", FeasibilitySettings),
        dataset=ARTIFACTS / "ingest",
        audit=ARTIFACTS / "audit",
        sweep=section.sweep,
        samples=section.samples,
        deployment=Deployment(
            horizons=params.horizons,
            deadline_s=answering.deadline_s,
            samples=stress.samples,
            replan_lead_rows=answering.replan_lead_rows,
            joining=stress.joining,
        ),
        root_seed=params.seed,
    )
    root = ARTIFACTS / "train_generators"
    candidates = trained(root, names, seeds=seeds, device=params.compute.device)
    brought = read_brought(params.section("candidates", BroughtSection).root, seed=seeds[0])
    with output_folder(ARTIFACTS / "reload") as folder:
        write_reload(plan, candidates, root / "fixtures.parquet", folder, brought=brought)


if __name__ == "__main__":
    main("reload", work)
