"""The benchmark that judges one set of weights as every kind: its entries, and what it compares."""

import argparse
import json
import shutil
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
import yaml
from safetensors.numpy import save_file

from benchmarks.each_kind import __main__ as command
from benchmarks.each_kind import compared, lerobot
from benchmarks.each_kind.compared import ABSENT, Apart, Judged, apart, differing, judged
from benchmarks.kinds import KINDS
from benchmarks.ladder_truth.bringing import FLOW, TWIN
from gates.report import Answer
from genpolicy.candidates.brought import require_brought
from genpolicy.contract.chunk import actions_sha256
from genpolicy.errors import BadInputError
from genpolicy.evidence.fixtures_again import brought_fixtures, fixture_name
from genpolicy.evidence.reproducibility.identity import Deployment, card_of
from genpolicy.integrity.tables import write_table
from genpolicy.policies.fixtures import CANDIDATES
from genpolicy.policies.policy import load_policy

ROOT = Path(__file__).parents[2]


def draw(policy, data):
    seen = brought_fixtures(data, policy.horizons)
    names = [fixture_name(row) for row in range(len(seen))]
    return policy.sample(seen, noise_names=names, candidates=CANDIDATES).actions


@pytest.fixture
def workspace(fleet, dataset, data, kit, tmp_path, monkeypatch):
    """What a ladder leaves behind `reload`, as far as bringing and comparing read it."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    place = tmp_path / "ladder"
    shutil.copytree(fleet[0] / "flow" / "seed_0", place / FLOW)
    (place / "artifacts" / "ingest").symlink_to(dataset)
    (place / "artifacts" / "reload").mkdir()
    policy = load_policy(place / FLOW)
    deployment = Deployment(horizons=kit.HORIZONS, deadline_s=0.15, samples=2, replan_lead_rows=3)
    identity = {
        "card": asdict(card_of([policy], data, deployment)),
        "seed": [policy.checkpoint.config.training_seed],
    }
    (place / "artifacts/reload/identity.json").write_text(json.dumps({TWIN: identity}))
    params = {"horizons": kit.HORIZONS.model_dump(), "candidates": {},
              "gate_b": {"unmatched": {}}}  # fmt: skip
    (place / "params.yaml").write_text(yaml.safe_dump(params))
    return place


def test_each_kind_is_an_entry_that_the_ladder_takes_and_draws_what_the_network_draws(
    workspace, data, kit
):
    command.bring_each_kind(workspace)
    params = yaml.safe_load((workspace / "params.yaml").read_text())
    assert set(params["gate_b"]["unmatched"]) == {f"as_{kind}" for kind in KINDS}
    found = require_brought(
        params["candidates"], horizons=kit.HORIZONS, trained=[TWIN], root=workspace
    )
    assert {policy.entry.kind for policy in found} == set(KINDS)
    bare = draw(load_policy(workspace / FLOW), data)
    rows = [
        {"method": policy.name, "row": row, "sha256_trained": actions_sha256(chunks)}
        for policy in found
        for row, chunks in enumerate(bare)
    ]
    write_table(workspace / "artifacts/reload/samples.parquet", pa.Table.from_pylist(rows))
    far = apart(workspace)
    for kind, tolerance in command.TOLERANCE.items():
        seen = far[f"as_{kind}"]
        assert seen.largest <= tolerance and seen.fixtures == len(bare)
        # What was said at Gate B is here what the network draws, to the bit.
        assert seen.as_judged == (seen.identical == len(bare))
        assert seen.as_judged or tolerance > 0.0


def test_chunks_are_held_against_the_network_and_against_what_gate_b_was_answered():
    bare = np.zeros((3, 2, 16, 10))
    before = {row: actions_sha256(chunks) for row, chunks in enumerate(bare)}
    assert compared.compared(bare, bare, before) == Apart(0.0, 3, 3, as_judged=True)
    moved = bare.copy()
    moved[1, 0, 4, 2] = -2e-5
    assert compared.compared(moved, bare, before) == Apart(2e-5, 2, 3, as_judged=False)
    moved[1] = np.nan
    assert np.isnan(compared.compared(moved, bare, before).largest)


def answer(name="nfe_mismatch", *, verdict="PASS", measured=0.0, candidate="own"):
    return Answer(
        id=name, question="?", owner="model", candidate=candidate, measured=measured,
        interval=None, threshold=0.0, comparison="<=", reason="r", verdict=verdict, evidence=(),
        caveat="", counted="",
    )  # fmt: skip


def of(verdicts="PASS PASS PASS", **answers):
    by_gate = dict(zip(compared.GATES, verdicts.split(), strict=True))
    return Judged(by_gate, {("B", name): found for name, found in answers.items()})


def test_a_verdict_of_a_gate_or_of_a_criterion_that_differs_is_named():
    same = of(nfe_mismatch=answer())
    assert differing(same, same) == []
    assert differing(of("PASS FAIL PASS"), of()) == ["gate C: FAIL, of the twin PASS"]
    [said] = differing(of(nfe_mismatch=answer(verdict="FAIL", measured=2.0)), same)
    assert said == (
        "B nfe_mismatch FAIL (2, limit <= 0), of the twin B nfe_mismatch PASS (0, limit <= 0)"
    )
    # Matched is asked of nobody who was brought, conformance of nobody who was trained here.
    assert differing(of(conformance=answer("conformance")), same) == []


def test_what_the_reports_say_of_one_candidate_is_read(monkeypatch, tmp_path):
    def report(workspace, gate):
        said = {"own": "FAIL", "other": "PASS"} if gate == "B" else {"other": "PASS"}
        criteria = (answer(verdict="FAIL", measured=1.0), answer(candidate="other"))
        return SimpleNamespace(candidates=said, criteria=criteria if gate == "B" else ()), b""

    monkeypatch.setattr(compared, "read_report", report)
    (tmp_path / "reports").mkdir()
    for gate in "bc":  # Gate D has not run
        (tmp_path / "reports" / f"gate_{gate}.json").touch()
    found = judged(tmp_path, "own")
    assert found.verdicts == {"B": "FAIL", "C": ABSENT, "D": ABSENT}
    assert found.unmet == ["B nfe_mismatch FAIL (1, limit <= 0)"]


def test_the_same_weights_must_be_judged_the_same_and_draw_the_same():
    found = {name: of() for name in (TWIN, *(f"as_{kind}" for kind in KINDS))}
    far = {f"as_{kind}": Apart(command.TOLERANCE[kind], 32, 32, True) for kind in KINDS}
    assert command.wrong(found, far) == []
    faults = [
        ({}, {"as_torch": Apart(2e-5, 0, 32, True)}, "as_torch: chunks 2.0e-05 apart"),
        ({}, {"as_server": Apart(1e-9, 31, 32, True)}, "as_server: chunks 1.0e-09 apart"),
        ({}, {"as_onnx": Apart(float("nan"), 0, 32, True)}, "as_onnx: chunks nan apart"),
        ({}, {"as_trained": Apart(0.0, 32, 32, False)}, "as_trained: now it answers"),
        ({"as_onnx": of("PASS PASS FAIL")}, {}, "as_onnx: gate D: FAIL"),
    ]
    for judged_so, drawn_so, named in faults:
        [said] = command.wrong({**found, **judged_so}, {**far, **drawn_so})
        assert said.startswith(named)


def test_limits_that_somebody_breaks_are_moved_to_what_was_measured_and_no_others(tmp_path):
    limits = {
        "nfe_mismatch": [0.0, "r"],
        "conformance": [0.0, "r"],
        "late_change_upper": [0.5, "r"],
    }
    params = {"gate_b": {"limits": {"model": limits}}}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(params))
    own = of(
        nfe_mismatch=answer(), conformance=answer("conformance", verdict="FAIL", measured=2.0),
        late_change_upper=answer("late_change_upper", verdict="INCONCLUSIVE", measured=None),
    )  # fmt: skip
    worse = of(conformance=answer("conformance", verdict="FAIL", measured=3.0))
    command.widen(tmp_path, "C", [worse, own])
    assert yaml.safe_load((tmp_path / "params.yaml").read_text()) == params
    command.widen(tmp_path, "B", [worse, own])
    found = yaml.safe_load((tmp_path / "params.yaml").read_text())["gate_b"]["limits"]["model"]
    assert found == {**limits, "conformance": [3.0, "r"]}


def test_each_gate_is_kept_as_it_judged_before_a_limit_moves(tmp_path, monkeypatch):
    place, kept, ran = tmp_path / "ladder", tmp_path / "kept", []
    (place / "reports").mkdir(parents=True)
    moved = []

    def run(workspace, *stages):
        for gate in "BCD":
            (workspace / "reports" / f"gate_{gate.lower()}.json").write_text(str(list(moved)))
        ran.append(stages)

    monkeypatch.setattr(command, "run", run)
    monkeypatch.setattr(command, "judged", lambda kept, name: name)
    monkeypatch.setattr(command, "widen", lambda workspace, gate, own: moved.append((gate, *own)))
    command.judge(place, kept, ["lero"])
    assert ran == [("gate_b",), ("gate_c",), ("gate_d",), ()]
    assert moved == [("B", "lero"), ("C", "lero")]  # above Gate D nobody is kept out
    texts = [(kept / "reports" / f"gate_{gate}.json").read_text() for gate in "bcd"]
    assert texts == ["[]", "[('B', 'lero')]", "[('B', 'lero'), ('C', 'lero')]"]
    ran.clear()
    command.judge(place, kept, ["lero"])  # one that was killed behind Gate D
    assert ran == [()] and texts[0] == (kept / "reports" / "gate_b.json").read_text()


def test_the_table_names_each_candidate_once():
    found = {TWIN: of(), "as_torch": of("PASS FAIL FAIL")}
    lines = command.table(found, {"as_torch": Apart(3e-8, 1, 32, True)}).splitlines()
    assert lines[2:] == [
        "| `flow` | PASS | PASS | PASS | - | - | - |",
        "| `as_torch` | PASS | FAIL | FAIL | 3.0e-08 | 1 of 32 | yes |",
    ]


def test_a_name_and_a_folder():
    assert command.named("act=a=b") == ("act", Path("a=b"))
    for word in ("act", "act=", "=a"):
        with pytest.raises(argparse.ArgumentTypeError, match="NAME=FOLDER"):
            command.named(word)


ACT = {"type": "act", "n_obs_steps": 1, "chunk_size": 16, "dim_model": 128,
       "n_encoder_layers": 4, "n_decoder_layers": 1}  # fmt: skip
DIFFUSION = {
    "type": "diffusion", "n_obs_steps": 2, "n_action_steps": 16, "down_dims": [64, 128],
    "noise_scheduler_type": "DDIM", "num_train_timesteps": 100, "num_inference_steps": 8,
    "beta_schedule": "squaredcos_cap_v2", "prediction_type": "epsilon",
}  # fmt: skip


@pytest.fixture
def trained(tmp_path, data):
    """A folder as LeRobot leaves it, by its config, and the export that it was trained on."""

    def folder(config, *, dataset=data.manifest_sha256):
        place = tmp_path / config["type"]
        place.mkdir()
        (place / "config.json").write_text(json.dumps(config))
        (place / "train_config.json").write_text(json.dumps({"seed": 1000}))
        numbers = np.zeros((3, 5), np.float32)
        tensors = {"model.head.weight": numbers, "model.vae_encoder.weight": numbers}
        save_file(tensors, place / "model.safetensors")
        export = tmp_path / "export" / "meta"
        export.mkdir(parents=True, exist_ok=True)
        said = {"dataset_manifest_sha256": dataset}
        (export / "genpolicy.json").write_text(json.dumps(said))
        return place, export.parent

    return folder


@pytest.mark.parametrize("config", [ACT, DIFFUSION], ids=["act", "diffusion"])
def test_a_policy_of_lerobot_is_an_entry_that_the_ladder_takes(
    workspace, trained, kit, tmp_path, config
):
    python = tmp_path / "python"
    python.touch()
    folder, export = trained(config)
    (workspace / "own").mkdir()
    lerobot.bring(workspace, "lero", folder, interpreter=python, data=export)
    section = yaml.safe_load((workspace / "params.yaml").read_text())["candidates"]
    [found] = require_brought(section, horizons=kit.HORIZONS, root=workspace)
    assert set(found.entry.files) == {"lero/config.json", "lero/model.safetensors"}
    assert {part.history for part in found.entry.observation.values()} == {config["n_obs_steps"]}
    declared, diffuses = found.entry.declared, config["type"] == "diffusion"
    assert found.entry.stochastic == diffuses
    assert (declared.evaluations, declared.eta) == ((8, 0.0) if diffuses else (1, None))
    # What only a training reads is no part of the network that runs.
    assert (declared.training_seed, declared.parameters) == (1000, 15)


@pytest.mark.parametrize(
    ("config", "exported", "named"),
    [
        ({**DIFFUSION, "n_action_steps": 15}, None, "a policy of 15 actions"),
        ({**ACT, "type": "pi0"}, None, "the type pi0"),
        (ACT, "0" * 64, "an export of the dataset 0000"),
    ],
    ids=["actions", "type", "dataset"],
)  # fmt: skip
def test_a_policy_of_lerobot_that_is_another_is_refused_and_nothing_is_written(
    workspace, trained, tmp_path, config, exported, named
):
    folder, export = trained(config, **({"dataset": exported} if exported else {}))
    before = (workspace / "params.yaml").read_bytes()
    with pytest.raises(BadInputError, match=named):
        lerobot.bring(workspace, "lero", folder, interpreter=tmp_path, data=export)
    assert (workspace / "params.yaml").read_bytes() == before
    assert not (workspace / "own").exists()
