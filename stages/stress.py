"""Stage `stress`: all methods on identical starts, deadlines and perturbations, in simulation."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from gates.proof import admit
from genpolicy.candidates.brought import BroughtSection, read_brought
from genpolicy.candidates.contenders import Contender, in_comparison
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.documents.stress import POWER, TRAININGS, Trainings, folder_of_seed
from genpolicy.evidence.fixtures_again import NO_FIXTURES, brought_fixtures
from genpolicy.evidence.reproducibility.latency import latency_models
from genpolicy.evidence.rows.reproducibility import LatencyRow
from genpolicy.evidence.rows.stress import SEVERITIES, SeverityRow
from genpolicy.evidence.stress.latency import LatencyModel, LatencySection
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.evidence.stress.power import power_document
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.evidence.stress.shard import Comparison
from genpolicy.evidence.stress.tables import plan_shards, write_stress
from genpolicy.evidence.stress.trainings import as_far, of_training
from genpolicy.evidence.stress.unseen import require_unseen
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.integrity.rows import read_columns, write_rows
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.statistics.planned_blocks import Rule, planned_rule, weighed
from genpolicy.tasks.api import load_task
from stages._contracts import require_one_contract
from stages._limits import REHEARSAL, require_pinned_limits
from stages._stage import ARTIFACTS, Params, main
from stages._training import MethodsSection


def work(params: Params) -> None:
    """Admit through gate C, then run every method under every perturbation.

    What was trained with several seeds runs with each, the first in the folder of the stage and
    every other one in a folder of its own, so that no row of another training is among those that
    promotion is judged by. Where starts are run in blocks, the first says how far each goes.
    """
    admitted = admit("stress", Path.cwd()).candidates
    require_one_contract("train_baselines", "train_generators", dataset=False)
    require_pinned_limits(params, Path.cwd())
    section = params.section("stress", StressSettings)
    timing = params.section("latency", LatencySection)
    table = read_columns(ARTIFACTS / "latency" / "latency.parquet", LatencyRow).to_pandas()
    task = load_task(params.task.name)
    seed, *further = params.section("policy", PolicySettings).seeds
    brought = read_brought(params.section("candidates", BroughtSection).root, seed=seed)
    fixtures = NO_FIXTURES
    if brought:
        fixtures = brought_fixtures(load_dataset(ARTIFACTS / "ingest"), params.horizons)
    drawn = matched_starts(task, root_seed=params.seed, count=section.starts)
    starts = tuple(start.to_json() for start in drawn)
    require_unseen(ARTIFACTS / "ingest", starts)
    comparison = Comparison(
        task=params.task.name,
        starts=starts,
        episode_limit_s=section.episode_limit_s,
        samples=section.samples,
        cell=Cell(params.horizons, params.section("execution", ExecutionSettings)),
        feasibility=params.section("feasibility", FeasibilitySettings),
        root_seed=params.seed,
        joining=section.joining,
        person=section.person,
        fixtures=fixtures,
    )
    judged = in_comparison(
        ARTIFACTS, baselines=section.baselines, candidates=admitted, brought=brought, seed=seed,
        device=params.compute.device, task=params.task.name, horizons=params.horizons,
    )  # fmt: skip
    # Alpha is shared between all that were registered, not between those that came this far.
    trained = params.section("train_generators", MethodsSection).samplers
    registered = len(trained) + len(brought)
    latency = latency_models(table, timing.declared_terms)
    power = power_document(section, candidates=registered, root_seed=params.seed)
    rule = planned_rule(
        starts=section.starts, block=section.block, conditions=list(section.perturbations),
        simple=section.baselines, margin=section.margin, alpha=section.alpha_of_each(registered),
        rehearsal=params.raw.get(REHEARSAL) is True,
        costs=weighed(params.raw.get("gate_d")),
    )  # fmt: skip
    with output_folder(ARTIFACTS / "stress") as folder:
        runs = {folder: judged}
        runs |= {folder / folder_of_seed(number): of_training(judged, number) for number in further}
        _run_each(params, section, runs, comparison=comparison, latency=latency, rule=rule)
        POWER.write(folder, power)
        if further:
            TRAININGS.write(folder, Trainings(seeds=further))
        if graded := section.severity_rows:
            write_rows(folder / SEVERITIES, SeverityRow, graded)


def _run_each(
    params: Params,
    section: StressSettings,
    runs: Mapping[Path, Sequence[Contender]],
    *,
    comparison: Comparison,
    latency: Mapping[str, LatencyModel],
    rule: Rule | None,
) -> None:
    """Run each training into its folder; the first says how far the others go."""
    ran: dict[str, int] = {}
    for place, compared in runs.items():
        place.mkdir(parents=True, exist_ok=True)
        shards = plan_shards(
            comparison, compared, section.conditions, latency=latency, journals=place / "journals"
        )
        shards = as_far(shards, ran) if ran else shards
        told = write_stress(
            place, shards, workers=params.compute.workers,
            scheduler=params.compute.scheduler, rule=None if ran else rule,
        )  # fmt: skip
        ran = ran if rule is None else ran or told


if __name__ == "__main__":
    main("stress", work)
