"""Short searches of a barely trained flow, as the stage `failure_search` writes them."""

from dataclasses import replace

from _probed import make_bench

from genpolicy.evidence.failure_search.conditions import searched_conditions
from genpolicy.evidence.failure_search.tables import plan_searches, write_searches
from genpolicy.evidence.stress.settings import StressSettings

EVALUATIONS = 3
CONDITIONS = ("nominal", "camera_delay")


def section(kit):
    """The section `stress` of these searches."""
    planned = kit.PARAMS["stress"]
    perturbations = {name: planned["perturbations"][name] for name in CONDITIONS}
    short = {"perturbations": perturbations, "episode_limit_s": 1.5, "samples": 2, "person": None}
    return {**planned, **short}


def plan(bench, kit, folder, **changes):
    """Every search of the flow; keywords replace what all share."""
    return plan_searches(
        replace(bench.comparison, **changes),
        bench.watched,
        searched_conditions(StressSettings(**section(kit))),
        evaluations=EVALUATIONS,
        latency=bench.latency,
        journals=folder / "journals",
    )


def write_searched(folder, bench, kit, *, workers=1):
    """All that the stage writes, into a folder that is made."""
    folder.mkdir(parents=True)
    searches = plan(bench, kit, folder)
    write_searches(folder, searches, workers=workers, scheduler="local")
    return searches


__all__ = ["CONDITIONS", "EVALUATIONS", "make_bench", "plan", "section", "write_searched"]
