"""Short rollouts of a barely trained flow under probes, as the stage `stress` writes them."""

import shutil
from types import SimpleNamespace

import numpy as np

from genpolicy.candidates.judged import trained
from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS
from genpolicy.evidence.monitors.plan import plan_judged, plan_thresholds
from genpolicy.evidence.monitors.scored import scorings
from genpolicy.evidence.monitors.settings import MonitorsSettings
from genpolicy.evidence.monitors.tables import Work, write_monitors
from genpolicy.evidence.stress.latency import DeclaredTerm, LatencyModel
from genpolicy.evidence.stress.shard import Comparison
from genpolicy.execution.cell import Cell, ExecutionSettings

SECTION = {
    "kinds": ["support", "own_loss", "seed_disagreement"],
    "alpha": 0.1,
    "threshold_starts": 2,
    "judged_starts": 2,
    "probe_starts": 1,
    "probes": {
        "lighting": {"severities": [1.0, 3.0]},
        "unseen_object": {"severities": [2.0], "felt": "contact"},
    },
}
ROOT_SEED = 5
LIMIT_S = 1.5


def make_bench(fleet, dataset, kit, artifacts):
    """Everything that a plan needs; outputs of the stages before lie in `artifacts`."""
    shutil.copytree(dataset, artifacts / "ingest")
    shutil.copytree(fleet[0] / "flow", artifacts / "train_generators" / "flow")
    latency = LatencyModel(
        {str(name): DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
        {str(name): np.full(8, 0.004) for name in MEASURED_TERMS},
        0.0,
    )
    comparison = Comparison(
        task="tabletop_insertion", starts=(), episode_limit_s=LIMIT_S, samples=2,
        cell=Cell(kit.HORIZONS, ExecutionSettings(**kit.PARAMS["execution"])),
        feasibility=kit.FEASIBILITY, root_seed=ROOT_SEED,
    )  # fmt: skip
    return SimpleNamespace(
        comparison=comparison,
        latency={"flow": latency},
        settings=MonitorsSettings(**SECTION),
        watched=trained(artifacts / "train_generators", ["flow"], seeds=[0], device="cpu"),
        artifacts=artifacts,
    )


def write_probed(folder, bench, task):
    """All that the stage writes, into an existing folder."""

    def plan(make):
        return make(
            bench.comparison, bench.watched, bench.settings, task,
            latency=bench.latency, journals=folder / "journals",
        )  # fmt: skip

    def judged():
        assert (folder / "thresholds.parquet").is_file(), "frozen before a judging start is drawn"
        return plan(plan_judged)

    write_monitors(
        folder,
        bench.settings,
        thresholds=plan(plan_thresholds),
        judged=judged,
        scoring=lambda shards: scorings(
            shards, bench.settings, artifacts=bench.artifacts, other_seeds=[]
        ),
        work=Work(1, "local"),
    )
