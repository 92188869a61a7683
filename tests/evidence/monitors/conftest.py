"""Short rollouts of a barely trained flow, and where its files lie."""

import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.candidates.judged import trained
from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS
from genpolicy.evidence.monitors.settings import MonitorsSettings
from genpolicy.evidence.stress.latency import DeclaredTerm, LatencyModel
from genpolicy.evidence.stress.shard import Comparison
from genpolicy.execution.cell import Cell, ExecutionSettings

SETTINGS = MonitorsSettings(
    kinds=["support", "own_loss", "seed_disagreement"],
    alpha=0.1,
    threshold_starts=2,
    judged_starts=2,
    probe_starts=1,
    probes={
        "lighting": {"severities": [1.0, 3.0]},
        "unseen_object": {"severities": [2.0], "felt": "contact"},
    },
)


@pytest.fixture(scope="session")
def artifacts(fleet, dataset, tmp_path_factory):
    """Outputs of the stages before: a dataset and one generator."""
    root = tmp_path_factory.mktemp("artifacts")
    shutil.copytree(dataset, root / "ingest")
    shutil.copytree(fleet[0] / "flow", root / "train_generators" / "flow")
    return root


@pytest.fixture(scope="session")
def bench(artifacts, kit):
    """Everything that a plan needs."""
    latency = LatencyModel(
        {str(name): DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
        {str(name): np.full(8, 0.004) for name in MEASURED_TERMS},
        0.0,
    )
    comparison = Comparison(
        task="tabletop_insertion", starts=(), episode_limit_s=1.5, samples=2,
        cell=Cell(kit.HORIZONS, ExecutionSettings(**kit.PARAMS["execution"])),
        feasibility=kit.FEASIBILITY, root_seed=5,
    )  # fmt: skip
    return SimpleNamespace(
        comparison=comparison,
        latency={"flow": latency},
        settings=SETTINGS,
        watched=trained(artifacts / "train_generators", ["flow"], seeds=[0]),
        artifacts=artifacts,
    )
