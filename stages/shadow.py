"""Stage `shadow`: many candidates on held-out and corrupted observations, down to the stub."""

from pathlib import Path

import pyarrow as pa
from pydantic import Field

from gates.proof import admit
from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.shadow.corruption import CORRUPTIONS
from genpolicy.evidence.shadow.shadow import (
    Shadow,
    held_out_observations,
    missing_checks_evidence,
    shadow_policy,
)
from genpolicy.evidence.shadow.tables import CANDIDATES, write_shadow
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.feasibility.checks import without
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.policies.policy import load_policy
from genpolicy.seeds import stream
from genpolicy.tasks.api import load_task
from stages._stage import ARTIFACTS, Params, main
from stages._study import StudySection


class ShadowSection(Settings):
    """Section `shadow`.

    Attributes:
        observations: Held-out observations, in equal numbers from every phase.
        candidates: Candidates per observation.
        late_steps: Actions that are late when a chunk arrives.
        mutant_observations: Observations on which each check is disabled once.
    """

    observations: int = Field(ge=1)
    candidates: int = Field(ge=2)
    late_steps: int = Field(ge=0)
    mutant_observations: int = Field(ge=1)


def work(params: Params) -> None:
    """Admit through gate B, then sample, check, corrupt and execute against the stub."""
    admit("shadow", Path.cwd())
    section = params.section("shadow", ShadowSection)
    feasibility = params.section("feasibility", FeasibilitySettings)
    seed = params.section("policy", PolicySettings).seeds[0]
    period_s = params.horizons.action_period_s
    task, data = load_task(params.task.name), load_dataset(ARTIFACTS / "ingest")
    shadow = Shadow(
        task=task,
        checker=make_checker(task, feasibility, action_period_s=period_s),
        horizons=params.horizons,
        execution=params.section("execution", ExecutionSettings),
        late_steps=section.late_steps,
        candidates=section.candidates,
    )
    observations = held_out_observations(
        data,
        horizons=params.horizons,
        count=section.observations,
        generator=stream(params.seed, "shadow", "observations"),
    )
    found = [
        shadow_policy(
            shadow,
            load_policy(ARTIFACTS / "generators" / method / f"seed_{seed}"),
            observations,
            seed=seed,
        )
        for method in params.section("generators", StudySection).samplers
    ]
    spacing = max(1, len(observations) // section.mutant_observations)
    mutants = missing_checks_evidence(
        shadow,
        observations[::spacing],
        without={
            item.checks: make_checker(
                task, feasibility, action_period_s=period_s, checks=without(*item.checks)
            )
            for item in CORRUPTIONS
            if item.checks
        },
    )
    with output_folder(ARTIFACTS / "shadow") as folder:
        rows = [row for item in found for row in item.candidates]
        write_shadow(
            folder,
            found,
            mutants,
            pa.Table.from_pylist(rows, CANDIDATES),
            horizons=shadow.horizons,
            execution=shadow.execution,
        )


if __name__ == "__main__":
    main("shadow", work)
