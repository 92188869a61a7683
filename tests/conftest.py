"""A small recorded dataset of the real task, and barely trained checkpoints on it."""

import copy
import gc
import os
import shutil
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stages  # noqa: F401  one thread and AVX2 for the tests too
from genpolicy.audit.rows import SituationRow
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.contract import TCP_ACTION, IngestContract, plausible_ranges
from genpolicy.data.dataset import load_dataset
from genpolicy.data.ingest import ingest_recordings
from genpolicy.errors import BadInputError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import read_yaml
from genpolicy.integrity.rows import write_rows
from genpolicy.policies.matched_training import PolicySettings, TrainingPlan, train_methods
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig
from genpolicy.tasks.api import load_task
from genpolicy.tasks.demonstrations import record_session

sys.path.insert(0, str(Path(__file__).parent))
from order import LONG, leave_out_long, longest_first

gc.disable()  # until all tests are collected: what is imported and collected stays

PARAMS = read_yaml(Path(__file__).parents[1] / "params.yaml")
HORIZONS = HorizonConfig(**PARAMS["horizons"])
EXECUTION = ExecutionSettings(**PARAMS["execution"])
FEASIBILITY = FeasibilitySettings(**PARAMS["feasibility"])
EPISODES = 10
SIDE_M = (0.0, 0.1, 0.0)
SAMPLERS = {
    "bc": SamplerConfig(name="direct"),
    "chunked_bc": SamplerConfig(name="direct"),
    "flow": SamplerConfig(name="euler", steps=2),
}
POLICY = PolicySettings(
    network=NetworkConfig(
        encoder_width=32, condition_dim=32, trunk_width=48, trunk_blocks=1, time_features=16,
        head_parameters=40_000,
    ),
    head=HeadConfig(posterior_width=16),
    training=TrainingConfig(updates=60, batch_size=64, learning_rate=3e-3, warmup_updates=5),
    seeds=[0],
    fixtures=5,
)  # fmt: skip


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    longest_first(items)
    if LONG not in os.environ:
        config.hook.pytest_deselected(items=leave_out_long(items))


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop() -> None:
    """What was collected stays to the end: no later search for garbage looks at it."""
    gc.freeze()
    gc.enable()


def write_situations(folder, rows):
    """An audit folder whose situations are `(uuid, index, changes)`."""
    folder.mkdir(exist_ok=True)
    straight = np.zeros((16, 3))
    left, right = straight + np.array(SIDE_M), straight - np.array(SIDE_M)
    plain = SituationRow(
        split="test", phase="approach", episode_uuid="", index=0, neighbours=12, clusters=2,
        cluster_sizes=(7, 6), two_mode=True, separation_m=0.2, mean_admissible=False,
        mean_reason="collision", median_admissible=False, modes_admissible=2,
        mean_path=tuple(straight.ravel()),
        mode_paths=(tuple(left.ravel()), tuple(right.ravel())), persistent=True,
        component="position",
    )  # fmt: skip
    table = [
        replace(plain, **{"episode_uuid": uuid, "index": index, **changes})
        for uuid, index, changes in rows
    ]
    write_rows(folder / "neighbourhoods.parquet", SituationRow, table)
    return folder


def uuids(data):
    return data.episodes["episode_uuid"].tolist()


@pytest.fixture(scope="session")
def kit():
    """Settings in force, by name."""
    return SimpleNamespace(
        PARAMS=PARAMS, HORIZONS=HORIZONS, EXECUTION=EXECUTION, FEASIBILITY=FEASIBILITY,
        POLICY=POLICY, SAMPLERS=SAMPLERS, write_situations=write_situations, uuids=uuids,
    )  # fmt: skip


@pytest.fixture(scope="session")
def task():
    return load_task("tabletop_insertion")


@pytest.fixture(scope="session")
def checker(task):
    return make_checker(task, FEASIBILITY, action_period_s=HORIZONS.action_period_s)


@pytest.fixture(scope="session")
def dataset(task, tmp_path_factory):
    """Folder of an ingested dataset of ten plain successes."""
    root = tmp_path_factory.mktemp("recorded")
    (root / "episodes").mkdir()
    names = record_session(
        task.name, root_seed=4, episodes=EPISODES, shares={"nominal": 1.0},
        folder=root / "episodes", workers=1, scheduler="local",
    )  # fmt: skip
    contract = IngestContract(
        observation=task.observation,
        phases=task.phases,
        action_period_s=HORIZONS.action_period_s,
        ranges=plausible_ranges(
            task.observation,
            TCP_ACTION,
            workspace_lower_m=np.array(task.workspace.lower_m),
            workspace_upper_m=np.array(task.workspace.upper_m),
        ),
    )
    ingest_recordings(
        [root / "episodes" / name for name in names], contract=contract, out=root / "dataset"
    )
    return root / "dataset"


@pytest.fixture(scope="session")
def data(dataset):
    loaded = load_dataset(dataset)
    assert loaded.episodes["outcome"].tolist() == ["success"] * EPISODES
    return loaded


@pytest.fixture(scope="session")
def fleet(dataset, tmp_path_factory):
    """Root folder of the checkpoints, and their hashes by method and seed."""
    root = tmp_path_factory.mktemp("fleet")
    plan = TrainingPlan(
        dataset=dataset, settings=POLICY, horizons=HORIZONS, root_seed=1, device="cpu", workers=1,
        scheduler="local", keep_earlier=True,
    )  # fmt: skip
    trained, _ = train_methods(plan, SAMPLERS, folder=root)
    return root, trained


@pytest.fixture(scope="session")
def policy(fleet):
    return load_policy(fleet[0] / "flow" / "seed_0")


@pytest.fixture(scope="session")
def foreign_folder(tmp_path_factory):
    """The package of a task that is installed outside the tree; free to be edited."""
    site = tmp_path_factory.mktemp("site-packages") / "installed"
    source = Path(__file__).parent / "foreign_task"
    shutil.copytree(source, site, ignore=shutil.ignore_patterns("__pycache__"))
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(site))
        yield site / "ring_cell"
    for name in [name for name in sys.modules if name.partition(".")[0] == "ring_cell"]:
        del sys.modules[name]


@pytest.fixture(scope="session")
def foreign_task(foreign_folder):
    """Registered name of that task: another arm, phases and bodies, and no gripper."""
    return "ring_cell"


def _places(document: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every key of a document, by its path; of a list the first entry stands for all."""
    entries = enumerate(document[:1]) if isinstance(document, list) else ()
    if isinstance(document, dict):
        entries = document.items()
    for key, value in entries:
        if isinstance(document, dict):
            yield (*at, key)
        yield from _places(value, (*at, key))


def _damaged(document: Any) -> Iterator[tuple[str, Any]]:
    """The document without each of its keys, and with each of them misspelt."""
    for *path, key in _places(document):
        for spelling in (None, f"{key}x"):
            changed = copy.deepcopy(document)
            inner = changed
            for part in path:
                inner = inner[part]
            value = inner.pop(key)
            if spelling is not None:
                inner[spelling] = value
            yield f"{'.'.join(map(str, (*path, key)))} -> {spelling}", changed


def _fallen_over(document: Any, read: Any) -> tuple[int, dict[str, str]]:
    """How many damaged documents were refused, and those that a reader fell over."""
    refused, faults = 0, {}
    for what, changed in _damaged(document):
        try:
            read(changed)
        except BadInputError as error:
            assert error.exit_code == 2 and error.where and error.action
            refused += 1
        except Exception as error:
            faults[what] = repr(error)
    return refused, faults


@pytest.fixture(scope="session")
def fallen_over():
    """`(document, read)`: each key deleted, and misspelt; how often it refused, and the faults."""
    return _fallen_over
