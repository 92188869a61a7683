"""A dataset or a checkpoint of another contract than the task's is refused by name."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from genpolicy.errors import ContractError
from genpolicy.integrity.hashing import sha256_file
from stages import train_baselines, train_factors, train_generators
from stages._contracts import require_contract_of_task, require_one_contract

TRAIN = (train_baselines, train_factors, train_generators)
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


@pytest.mark.parametrize("stage", TRAIN)
def test_nothing_is_trained_on_a_dataset_of_another_contract(artifacts, monkeypatch, stage):
    def trains(*_args, **_others):
        pytest.fail("it trained")

    for name, instead in (
        ("admit", lambda *_: None), ("train_matched", trains), ("train_variants", trains),
    ):  # fmt: skip
        monkeypatch.setattr(stage, name, instead, raising=False)
    artifacts("ingest/manifest.json", {**MANIFEST, "phases": ["q"]})
    with pytest.raises(ContractError, match=r"manifest\.json: phase"):
        stage.work(None)
