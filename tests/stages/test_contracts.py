"""A dataset or a checkpoint of another contract than the task's is refused by name."""

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from genpolicy.errors import ContractError
from genpolicy.integrity.hashing import sha256_file
from stages import (
    audit,
    failure_search,
    latency,
    measure_baselines,
    measure_factors,
    monitors,
    reload,
    shadow,
    stress,
    train_baselines,
    train_factors,
    train_generators,
    wall_clock,
)
from stages._contracts import require_contract_of_task, require_one_contract

STAGES = (
    audit, failure_search, latency, measure_baselines, measure_factors, monitors, reload, shadow,
    stress, train_baselines, train_factors, train_generators, wall_clock,
)  # fmt: skip
TRAINED = {
    failure_search: ("train_generators",), latency: ("train_baselines", "train_generators"),
    measure_baselines: ("train_baselines",), measure_factors: ("train_factors",),
    monitors: ("train_generators",), reload: ("train_generators",), shadow: ("train_generators",),
    stress: ("train_baselines", "train_generators"), train_generators: ("train_baselines",),
    wall_clock: ("train_generators",),
}  # fmt: skip
"""Whose checkpoints each of them reads."""
READING = [stage for stage in STAGES if stage not in (stress, failure_search)]
"""Who reads the dataset: who only rolls out asks for the checkpoints."""
TASK = {"observation_sha256": "o", "action_sha256": "a", "name": "t", "phases": {"all": ["p"]}}
MANIFEST = {
    "observation_contract": {"sha256": "o"}, "action_contract": {"sha256": "a"}, "phases": ["p"],
}  # fmt: skip


@pytest.fixture
def artifacts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, object], Path]:
    monkeypatch.chdir(tmp_path)

    def write(name: str, document: object) -> Path:
        path = tmp_path / "artifacts" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(document))
        return path

    write("task/identity.json", TASK)
    manifest = write("ingest/manifest.json", MANIFEST)
    write("train_x/m/seed_0/config.json", _config(sha256_file(manifest)))
    return write


def _config(dataset: str, observation: str = "o", action: str = "a") -> dict:
    return {
        "provenance": {
            "dataset_manifest_sha256": dataset,
            "observation_contract_sha256": observation,
            "action_contract_sha256": action,
        }
    }


def test_one_contract_everywhere_is_accepted(artifacts):
    require_one_contract("train_x")
    require_contract_of_task(MANIFEST, where="here")


@pytest.mark.parametrize("key", ["observation", "action", "phase"])
def test_a_dataset_of_another_contract_is_refused(artifacts, key):
    changed = {"phases": ["q"]} if key == "phase" else {f"{key}_contract": {"sha256": "x"}}
    artifacts("ingest/manifest.json", {**MANIFEST, **changed})
    with pytest.raises(ContractError, match=rf"manifest\.json: {key}"):
        require_one_contract()


@pytest.mark.parametrize("key", ["observation", "action"])
@pytest.mark.parametrize("dataset", [True, False])
def test_a_checkpoint_of_another_contract_is_refused(artifacts, key, dataset):
    digest = sha256_file(Path("artifacts/ingest/manifest.json"))
    artifacts("train_x/m/seed_0/config.json", _config(digest, **{key: "x"}))
    with pytest.raises(ContractError, match=rf"config\.json: {key}"):
        require_one_contract("train_x", dataset=dataset)


def test_a_checkpoint_of_another_dataset_is_refused_where_the_dataset_is_read(artifacts):
    artifacts("train_x/m/seed_0/config.json", _config("other"))
    require_one_contract("train_x", dataset=False)
    with pytest.raises(ContractError, match="dataset is other"):
        require_one_contract("train_x")


class Untouched:
    """Settings of which nobody may read anything before the contracts were compared."""

    def __getattr__(self, name):
        pytest.fail(f"{name} was read before the contracts were compared")


@pytest.fixture
def admitted(monkeypatch):
    """Every gate passed, so that nothing but the contracts can stop a stage."""
    for stage in STAGES:
        passed = SimpleNamespace(candidates=("flow",))
        monkeypatch.setattr(stage, "admit", lambda *_, passed=passed: passed, raising=False)


def test_every_stage_that_asks_is_among_these():
    folder = Path(audit.__file__).parent
    asking = {p.stem for p in folder.glob("*.py") if "import require_one_contract" in p.read_text()}
    assert asking == {stage.__name__.removeprefix("stages.") for stage in STAGES}


@pytest.mark.usefixtures("admitted")
@pytest.mark.parametrize("stage", READING, ids=lambda stage: stage.__name__)
def test_no_stage_begins_on_a_dataset_of_another_contract(artifacts, stage):
    artifacts("ingest/manifest.json", {**MANIFEST, "phases": ["q"]})
    with pytest.raises(ContractError, match=r"manifest\.json: phase"):
        stage.work(Untouched())


@pytest.mark.usefixtures("admitted")
@pytest.mark.parametrize(
    ("stage", "training"),
    [(stage, training) for stage, read in TRAINED.items() for training in read],
    ids=lambda item: item if isinstance(item, str) else item.__name__,
)
def test_no_stage_begins_with_a_checkpoint_of_another_contract(artifacts, stage, training):
    digest = sha256_file(Path("artifacts/ingest/manifest.json"))
    artifacts(f"{training}/m/seed_0/config.json", _config(digest, action="x"))
    with pytest.raises(ContractError, match=rf"{training}/.*config\.json: action"):
        stage.work(Untouched())
