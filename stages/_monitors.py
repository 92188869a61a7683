"""Part of the stage `stress`: admitted candidates under graded probes, scored by every monitor."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from genpolicy.candidates.contenders import Contender
from genpolicy.evidence.fixtures_again import NO_FIXTURES
from genpolicy.evidence.monitors.plan import (
    plan_judged,
    plan_thresholds,
    require_runnable,
)
from genpolicy.evidence.monitors.scored import Scoring, scorings
from genpolicy.evidence.monitors.settings import MonitorsSettings, monitors_settings
from genpolicy.evidence.monitors.tables import Work, write_monitors, write_unwatched
from genpolicy.evidence.stress.latency import LatencyModel
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.evidence.stress.shard import Comparison, Shard
from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.tasks.api import load_task
from stages._stage import ARTIFACTS, Params


def planned(params: Params) -> MonitorsSettings:
    """What is run under probes; read before the comparison, which takes hours.

    Args:
        params: The parameters; what is run stands in `stress.monitors`.

    Raises:
        ConfigError: `stress.monitors` has an unknown key or a wrong value, the task knows no such
            probe, or probes are asked for under a rule of joining that they cannot be scored under.
    """
    stress = params.section("stress", StressSettings)
    section = monitors_settings(stress.monitors)
    require_runnable(section, stress.joining, load_task(params.task.name), root_seed=params.seed)
    return section


def watch(
    params: Params,
    section: MonitorsSettings,
    comparison: Comparison,
    watched: Sequence[Contender],
    latency: Mapping[str, LatencyModel],
) -> None:
    """Run thresholds, freeze them, run what judges them, score all of it.

    Args:
        params: The parameters.
        section: What is run.
        comparison: What the rollouts of the comparison share; these have starts of their own.
        watched: Who was admitted.
        latency: Of each of them the time that an answer takes.
    """
    if not section.on:
        with output_folder(ARTIFACTS / "monitors") as folder:
            write_unwatched(folder)
        return
    seeds = params.section("policy", PolicySettings).seeds
    task = load_task(params.task.name)
    # Nobody comes: what a monitor is held against is how the policy ends by itself.
    alone = replace(comparison, starts=(), person=None, fixtures=NO_FIXTURES)

    def scoring(shards: Sequence[Shard]) -> list[Scoring]:
        return scorings(shards, section, artifacts=ARTIFACTS, other_seeds=seeds[1:])

    with output_folder(ARTIFACTS / "monitors") as folder:
        journals = folder / "journals"
        write_monitors(
            folder,
            section,
            thresholds=plan_thresholds(
                alone, watched, section, task, latency=latency, journals=journals
            ),
            judged=lambda: plan_judged(
                alone, watched, section, task, latency=latency, journals=journals
            ),
            scoring=scoring,
            work=Work(params.compute.workers, params.compute.scheduler),
        )
