"""A key that is gone or misspelt in an input document is bad input (2), never a fault of ours (1).

Each document is taken from the real thing, and each of its keys is deleted and renamed in turn. A
reader may do without a key; it may not fall over it.
"""

import importlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from genpolicy.data.dataset import load_dataset
from genpolicy.data.of_task import IngestSection
from genpolicy.evidence.reproducibility.swept import SweepSection
from genpolicy.evidence.shadow.settings import ShadowSection
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import canonical_json
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.policies.policy import load_policy
from genpolicy.tasks.fixtures import fixture_hashes, require_pinned
from genpolicy.tasks.identity import task_identity
from stages._contracts import require_one_contract
from stages._source import SourceSection, refuse_foreign_files
from stages._stage import STAGES, load_params

ROOT = Path(__file__).parents[2]
PARAMS = yaml.safe_load((ROOT / "params.yaml").read_text())


def test_the_damage_is_damage(fallen_over):
    seen = []
    fallen_over({"a": {"b": 1}, "c": [{"d": 2}, {"d": 3}]}, seen.append)
    assert len(seen) == 8 and {"a": {}, "c": [{"d": 2}, {"d": 3}]} in seen
    refused, faults = fallen_over({"a": {"b": 1}}, lambda document: document["a"]["b"])
    assert refused == 0 and len(faults) == 4


def section_models() -> dict[str, type]:
    """By name of a section: the class that its stage parses it with."""
    found = {}
    for name in STAGES:
        for value in vars(importlib.import_module(f"stages.{name}")).values():
            own = getattr(value, "__module__", "") == f"stages.{name}"
            if own and isinstance(value, type) and value.__name__.endswith("Section"):
                found[name] = value
    return found


def test_params(monkeypatch, fallen_over):
    models = section_models() | {
        "execution": ExecutionSettings, "feasibility": FeasibilitySettings,
        "policy": PolicySettings, "reload": SweepSection, "source": SourceSection,
        "shadow": ShadowSection, "ingest": IngestSection,
    }  # fmt: skip
    assert len(models) > 8

    def read(document: Any) -> None:
        monkeypatch.setattr("stages._stage.read_yaml", lambda path: document)
        params = load_params()
        for name, model in models.items():
            params.section(name, model)

    small = {name: value for name, value in PARAMS.items() if not name.startswith("gate_")}
    read(small)
    refused, faults = fallen_over(small, read)
    assert faults == {} and refused > 100


def test_fixtures(tmp_path, fallen_over):
    pins = yaml.safe_load((ROOT / "fixtures.yaml").read_text())
    found = fixture_hashes(task_identity("tabletop_insertion"))

    def read(document: Any) -> None:
        (tmp_path / "fixtures.yaml").write_text(yaml.safe_dump(document))
        require_pinned(tmp_path, "tabletop_insertion", found)

    read(pins)
    refused, faults = fallen_over(pins, read)
    assert faults == {} and refused == 2 * (1 + len(found))


def test_manifest_of_a_dataset(dataset, tmp_path, fallen_over):
    folder = tmp_path / "dataset"
    folder.mkdir()
    for path in dataset.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    whole = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").unlink()

    def read(document: Any) -> None:
        (folder / "manifest.json").write_bytes(canonical_json(document))
        load_dataset(folder)

    read(whole)
    refused, faults = fallen_over(whole, read)
    assert faults == {} and refused > 20


def test_configuration_of_a_checkpoint_and_its_sampler(fleet, tmp_path, fallen_over):
    root, _ = fleet
    folder = tmp_path / "flow"
    shutil.copytree(root / "flow" / "seed_0", folder)
    whole = json.loads((folder / "config.json").read_text())
    assert "sampler" in whole

    def read(document: Any) -> None:
        (folder / "config.json").write_bytes(canonical_json(document))
        load_policy(folder)

    read(whole)
    refused, faults = fallen_over(whole, read)
    assert faults == {} and refused > 50


@pytest.mark.parametrize("name", [
    "task/identity.json", "ingest/manifest.json", "train_generators/flow/seed_0/config.json",
    "record/index.json",
])  # fmt: skip
def test_what_the_stages_compare(name, fleet, dataset, tmp_path, monkeypatch, fallen_over):
    monkeypatch.chdir(tmp_path)
    config = (fleet[0] / "flow" / "seed_0" / "config.json").read_text()
    documents = {
        "task/identity.json": task_identity("tabletop_insertion"),
        "ingest/manifest.json": json.loads((dataset / "manifest.json").read_text()),
        "train_generators/flow/seed_0/config.json": json.loads(config),
        "record/index.json": {"files": {"a.mcap": "ab"}},
    }
    for path, document in documents.items():
        target = tmp_path / "artifacts" / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(canonical_json(document))

    def read(document: Any) -> None:
        (tmp_path / "artifacts" / name).write_bytes(canonical_json(document))
        require_one_contract("train_generators")
        refuse_foreign_files()

    read(documents[name])
    refused, faults = fallen_over(documents[name], read)
    assert faults == {} and (refused > 0 or name == "record/index.json")
