"""Stage `stress`: all methods on identical starts, deadlines and perturbations, in simulation."""

from pathlib import Path

from gates.proof import admit
from genpolicy.evidence.reproducibility.latency import latency_models
from genpolicy.evidence.stress.matched import Shard, matched_starts
from genpolicy.evidence.stress.tables import Entrant, StressSettings, plan_shards, write_stress
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.integrity.tables import read_table
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.policies.policy import load_policy
from genpolicy.tasks.api import load_task
from stages._stage import ARTIFACTS, Params, main
from stages._study import StudySection
from stages._timing import LatencySection


def work(params: Params) -> None:
    """Admit through gate C, then run every method under every perturbation."""
    admit("stress", Path.cwd())
    section = params.section("stress", StressSettings)
    seed = params.section("policy", PolicySettings).seeds[0]
    roots = {name: ARTIFACTS / "baselines" for name in section.baselines}
    generators = params.section("generators", StudySection).samplers
    roots |= {name: ARTIFACTS / "generators" for name in generators}
    entrants = []
    for method, root in roots.items():
        checkpoint = root / method / f"seed_{seed}"
        entrants.append(Entrant(method, checkpoint, load_policy(checkpoint).checkpoint_hash))
    models = latency_models(
        read_table(ARTIFACTS / "latency" / "latency.parquet").to_pandas(),
        params.section("latency", LatencySection).declared,
    )
    task = load_task(params.task.name)
    starts = matched_starts(task, root_seed=params.seed, count=section.starts)
    texts = tuple(start.to_json() for start in starts)
    with output_folder(ARTIFACTS / "stress") as folder:
        shards = [
            Shard(
                task=params.task.name,
                method=entrant.method,
                seed=seed,
                checkpoint=entrant.checkpoint,
                sha256=entrant.sha256,
                perturbation=name,
                schedule=schedule,
                starts=texts,
                episode_limit_s=section.episode_limit_s,
                candidates=section.candidates,
                horizons=params.horizons,
                execution=params.section("execution", ExecutionSettings),
                feasibility=params.section("feasibility", FeasibilitySettings),
                latency=models[entrant.method],
                root_seed=params.seed,
                journal=folder / "journals" / f"{entrant.method}__{name}.mcap",
            )
            for entrant, name, schedule in plan_shards(entrants, section.perturbations)
        ]
        write_stress(
            folder,
            shards,
            section,
            workers=params.compute.workers,
            scheduler=params.compute.scheduler,
            root_seed=params.seed,
        )


if __name__ == "__main__":
    main("stress", work)
