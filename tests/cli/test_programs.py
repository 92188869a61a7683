"""`genpolicy export torch|onnx` and entries of every kind, as the docs write them."""

import json
import os
import re
import shlex
import shutil
from pathlib import Path

import pytest
import yaml

from genpolicy.candidates.described import architecture_of
from genpolicy.candidates.hosts import onnx_library
from genpolicy.cli.main import main
from genpolicy.evidence.split import split_sha256
from genpolicy.integrity.hashing import sha256_file
from genpolicy.policies.policy import load_policy

ROOT = Path(__file__).parents[2]
DOCS = (ROOT / "docs" / "candidates.md").read_text()
PLANNER = """
import numpy as np
def plan(inputs):
    return np.repeat(inputs["observation"][-1:, :10], 16, axis=0)
"""
FILES = {
    "trained": ("flow/seed_0/config.json", "flow/seed_0/model.safetensors"),
    "torch": ("sampler.pt2", "encoder.pt2"),
    "onnx": ("sampler.onnx", "encoder.onnx"),
    "scripted": ("planner.py",),
}


def fields(name):
    """An entry of the docs, or the part of one that stands there."""
    [text] = re.findall(rf"```yaml\n# {name}\.yaml\n(.*?)```", DOCS, re.DOTALL)
    return yaml.safe_load(text)


@pytest.fixture(autouse=True)
def children(monkeypatch):
    """What is started here runs this code, whatever is installed."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))


@pytest.fixture(scope="module")
def place(fleet, tmp_path_factory):
    """A folder with a checkpoint, its exports by the commands of the docs, and a planner."""
    folder = tmp_path_factory.mktemp("kinds")
    shutil.copytree(fleet[0] / "flow", folder / "flow")
    (folder / "planner.py").write_text(PLANNER)
    lines = re.findall(r"^genpolicy (export (?:torch|onnx) .*)$", DOCS, re.MULTILINE)
    assert len(lines) == 2
    before = Path.cwd()
    os.chdir(folder)
    try:
        for line in lines:
            assert main(shlex.split(line)) == 0
    finally:
        os.chdir(before)
    return folder


def entry_of(place, kind):
    """The entry of the docs with the part of a kind in place of that of a server."""
    part = fields("torch" if kind == "onnx" else kind)
    if kind == "onnx":
        part = yaml.safe_load(yaml.safe_dump(part).replace(".pt2", ".onnx"))
        part["kind"] = "onnx"
    base = {name: value for name, value in fields("candidate").items() if name != "command"}
    entry = {**base, **part, "timeout_s": 20.0, "start_timeout_s": 300.0}
    assert set(entry["files"]) == set(FILES[kind])
    entry["files"] = {name: sha256_file(place / name) for name in FILES[kind]}
    if "noise" in entry:
        entry["noise"]["stream"] = load_policy(place / "flow" / "seed_0").checkpoint_hash
    path = place / f"{kind}.yaml"
    path.write_text(yaml.safe_dump(entry))
    return path


def true_of(place):
    """What the checkpoint knows of itself, in place of the numbers of the docs."""
    policy = load_policy(place / "flow" / "seed_0")
    config, steps = policy.checkpoint.config, policy.sampler.steps
    return {
        "training_seed": config.training_seed, "architecture": architecture_of(config),
        "parameters": config.parameters["total"], "sampler_steps": steps, "evaluations": steps,
        "batch_rows": policy.sampler.batch_rows,
    }  # fmt: skip


@pytest.mark.parametrize("kind", ["trained", "torch", "onnx", "scripted"])
def test_the_entries_of_the_docs_are_checked(place, dataset, capsys, kind):
    path = entry_of(place, kind)
    [text] = re.findall(r"```yaml\n(declared:.*?)```", DOCS, re.DOTALL)
    manifest = dataset / "manifest.json"
    split = split_sha256(json.loads(manifest.read_bytes()))
    text = text.replace("@manifest@", sha256_file(manifest)).replace("@split@", split)
    declared = yaml.safe_load(text)["declared"] | (true_of(place) if kind == "trained" else {})
    path.write_text(yaml.safe_dump({**yaml.safe_load(path.read_text()), "declared": declared}))
    words = ["check-candidate", str(path), "--dataset", str(dataset), "--deadline", "20", "--json"]
    assert main(words) == 0
    found = json.loads(capsys.readouterr().out)
    judged = {finding["name"]: finding["judged"] for finding in found["findings"]}
    unknown = {"evaluations", "spans"} if kind == "scripted" else set()
    holds = {"answers", "repeats", "restarts", "seeded", "evaluations", "spans"} - unknown
    assert {name for name in judged if judged[name] == "holds"} >= holds
    assert {name for name in unknown if judged[name] != "unknown"} == set()


def test_what_is_printed_is_what_the_docs_say(place, tmp_path, capsys):
    out = tmp_path / "sampler.pt2"
    checkpoint = place / "flow" / "seed_0"
    encoder = tmp_path / "encoder.pt2"
    words = ["export", "torch", str(checkpoint), "--out", str(out), "--encoder", str(encoder)]
    assert main(words) == 0
    said, docs = yaml.safe_load(capsys.readouterr().out), fields("torch")
    for name in ("kind", "program", "encoder", "counted_weight"):
        assert said[name] == docs[name]
    assert set(said["files"]) == set(docs["files"])
    assert said["files"]["sampler.pt2"] == sha256_file(out)
    assert said["noise"] == {**docs["noise"], "stream": load_policy(checkpoint).checkpoint_hash}
    assert out.read_bytes() == (place / "sampler.pt2").read_bytes()
    assert main(words) == 2
    assert "--force" in capsys.readouterr().err


def test_a_file_for_both_and_a_library_that_is_absent(place, tmp_path, capsys, monkeypatch):
    checkpoint, out = str(place / "flow" / "seed_0"), str(tmp_path / "policy.onnx")
    assert main(["export", "torch", checkpoint, "--out", out, "--encoder", out]) == 2
    assert "a file of its own" in capsys.readouterr().err
    monkeypatch.setattr(onnx_library, "find_spec", lambda name: None)
    assert main(["export", "onnx", checkpoint, "--out", out]) == 2
    assert "pip install 'genpolicy[onnx]'" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("width", ["observation", "=3", "observation=x"])
def test_a_width_that_is_none(place, capsys, width):
    path = entry_of(place, "scripted")
    assert main(["serve-candidate", str(path), "--width", width]) == 2
    assert "NAME=NUMBER" in capsys.readouterr().err


def test_a_child_that_refuses_says_why(place, dataset, capsys):
    path = entry_of(place, "scripted")
    entry = yaml.safe_load(path.read_text())
    path.write_text(yaml.safe_dump({**entry, "function": "planner:nothing"}))
    assert main(["check-candidate", str(path), "--dataset", str(dataset)]) == 2
    assert "without the function nothing" in capsys.readouterr().err


def test_a_checkpoint_that_is_declared_as_another_is_refused_with_both_sides(
    place, dataset, capsys
):
    """Wrong before: the finding `declared` held for it."""
    path = entry_of(place, "trained")
    [text] = re.findall(r"```yaml\n(declared:.*?)```", DOCS, re.DOTALL)
    text = re.sub('"@(manifest|split)@"', repr("0" * 64), text)
    path.write_text(yaml.safe_dump({**yaml.safe_load(path.read_text()), **yaml.safe_load(text)}))
    assert main(["check-candidate", str(path), "--dataset", str(dataset)]) == 2
    said = capsys.readouterr().err
    assert "declared.parameters 812345" in said and "as `config.json` of its checkpoint" in said
