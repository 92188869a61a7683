"""Stage `shadow`: many candidates on held-out and corrupted observations, down to the stub."""

from pathlib import Path

from gates.proof import admit
from genpolicy.candidates.brought import BroughtSection, read_brought
from genpolicy.candidates.contenders import admitted_contenders, opened
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.fixtures_again import NO_FIXTURES, asked_again, brought_fixtures
from genpolicy.evidence.rows.brought import AFTER, BEFORE
from genpolicy.evidence.shadow.gallery import gallery_of
from genpolicy.evidence.shadow.layer_mutants import missing_checks_evidence
from genpolicy.evidence.shadow.observations import (
    held_out_observations,
    spread,
    two_mode_observations,
)
from genpolicy.evidence.shadow.settings import ShadowSection
from genpolicy.evidence.shadow.shadow import Shadow, shadow_policy
from genpolicy.evidence.shadow.tables import write_shadow
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.seeds import stream
from genpolicy.tasks.api import load_task
from stages._contracts import require_one_contract
from stages._limits import require_pinned_limits
from stages._stage import ARTIFACTS, Params, main


def work(params: Params) -> None:
    """Admit through gate B, then sample, check, corrupt and execute against the stub."""
    admitted = admit("shadow", Path.cwd()).candidates
    require_one_contract("train_generators")
    require_pinned_limits(params, Path.cwd())
    section = params.section("shadow", ShadowSection)
    feasibility = params.section("feasibility", FeasibilitySettings)
    seed = params.section("policy", PolicySettings).seeds[0]
    period_s = params.horizons.action_period_s
    task = load_task(params.task.name)
    shadow = Shadow(
        task=task,
        checker=make_checker(task, feasibility, action_period_s=period_s),
        cell=Cell(params.horizons, params.section("execution", ExecutionSettings)),
        late_rows=section.late_rows,
        samples=section.samples,
    )
    data = load_dataset(ARTIFACTS / "ingest")
    two_mode = two_mode_observations(data, ARTIFACTS / "audit", horizons=params.horizons)
    observations = held_out_observations(
        data,
        horizons=params.horizons,
        count=section.observations,
        generator=stream(params.seed, "shadow", "observations"),
    )
    brought = read_brought(params.section("candidates", BroughtSection).root, seed=seed)
    fixtures = brought_fixtures(data, params.horizons) if brought else NO_FIXTURES
    candidates = admitted_contenders(
        ARTIFACTS, admitted, brought, seed=seed, device=params.compute.device
    )
    with output_folder(ARTIFACTS / "shadow") as folder:
        found, again = [], []
        for candidate in candidates:
            with opened(candidate, task.observation, scene=task.scene_path) as policy:
                again += asked_again(policy, fixtures, condition="shadow", when=BEFORE)
                seen = shadow_policy(
                    shadow, policy, observations, seed=candidate.seed, two_mode=two_mode
                )
                again += asked_again(policy, fixtures, condition="shadow", when=AFTER)
            found.append(seen)
        mutants = missing_checks_evidence(shadow, spread(observations, section.mutant_observations))
        rows = [row for item in found for row in item.candidates]
        gallery = gallery_of(shadow, observations, rows)
        write_shadow(
            folder, found, mutants, gallery, cell=shadow.cell, robot=shadow.checker.cell,
            again=again,
        )  # fmt: skip


if __name__ == "__main__":
    main("shadow", work)
