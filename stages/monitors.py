"""Stage `monitors`: admitted candidates under graded probes, scored by every monitor.

It reads nothing of the comparison: what changes here alone leaves `stress` as it is.
"""

from collections.abc import Sequence
from pathlib import Path

from gates.proof import admit
from genpolicy.candidates.brought import BroughtSection, read_brought
from genpolicy.candidates.contenders import admitted_contenders
from genpolicy.evidence.monitors.plan import plan_judged, plan_thresholds, require_runnable
from genpolicy.evidence.monitors.scored import Scoring, scorings
from genpolicy.evidence.monitors.settings import MonitorsSettings
from genpolicy.evidence.monitors.tables import Work, write_monitors, write_unwatched
from genpolicy.evidence.reproducibility.latency import latency_models
from genpolicy.evidence.rows.reproducibility import LatencyRow
from genpolicy.evidence.stress.latency import LatencySection
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.evidence.stress.shard import Comparison, Shard
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.integrity.rows import read_columns
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.tasks.api import load_task
from stages._contracts import require_one_contract
from stages._stage import ARTIFACTS, Params, main


def work(params: Params) -> None:
    """Admit through gate C, then run thresholds, freeze them, run what judges them, score it."""
    admitted = admit("monitors", Path.cwd()).candidates
    require_one_contract("train_generators")
    section = params.section("monitors", MonitorsSettings)
    joining = params.section("stress", StressSettings).joining
    require_runnable(section, joining, load_task(params.task.name), root_seed=params.seed)
    with output_folder(ARTIFACTS / "monitors") as folder:
        if section.on:
            _watch(folder, params, section, admitted)
        else:
            write_unwatched(folder)


def _watch(
    folder: Path, params: Params, section: MonitorsSettings, admitted: Sequence[str]
) -> None:
    seeds = params.section("policy", PolicySettings).seeds
    task = load_task(params.task.name)
    comparison = _comparison(params)
    brought = read_brought(params.section("candidates", BroughtSection).root, seed=seeds[0])
    watched = admitted_contenders(
        ARTIFACTS, admitted, brought, seed=seeds[0], device=params.compute.device
    )
    table = read_columns(ARTIFACTS / "latency" / "latency.parquet", LatencyRow).to_pandas()
    latency = latency_models(table, params.section("latency", LatencySection).declared_terms)
    journals = folder / "journals"

    def scoring(shards: Sequence[Shard]) -> list[Scoring]:
        return scorings(shards, section, artifacts=ARTIFACTS, other_seeds=seeds[1:])

    write_monitors(
        folder,
        section,
        thresholds=plan_thresholds(
            comparison, watched, section, task, latency=latency, journals=journals
        ),
        judged=lambda: plan_judged(
            comparison, watched, section, task, latency=latency, journals=journals
        ),
        scoring=scoring,
        work=Work(params.compute.workers, params.compute.scheduler),
    )


def _comparison(params: Params) -> Comparison:
    """What all rollouts share with those of `stress`, whose starts these do not take.

    Nobody comes when a person is called: what a monitor is held against is how the policy ends by
    itself.
    """
    stress = params.section("stress", StressSettings)
    return Comparison(
        task=params.task.name,
        starts=(),
        episode_limit_s=stress.episode_limit_s,
        samples=stress.samples,
        cell=Cell(params.horizons, params.section("execution", ExecutionSettings)),
        feasibility=params.section("feasibility", FeasibilitySettings),
        root_seed=params.seed,
        joining=stress.joining,
    )


if __name__ == "__main__":
    main("monitors", work)
