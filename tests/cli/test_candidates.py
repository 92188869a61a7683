"""`genpolicy check-candidate` and `serve-policy`, as a user types them; the docs' own example."""

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import torch
import yaml

from genpolicy.candidates.wire.connection import Listening, dial
from genpolicy.cli import candidates as checking
from genpolicy.cli.candidates import ASKED_LATER
from genpolicy.cli.main import main
from genpolicy.evidence.split import split_sha256
from genpolicy.integrity.hashing import sha256_file

DOCS = Path(__file__).parents[2] / "docs" / "candidates.md"
PYTHON = [sys.executable, "-m", "genpolicy"]


@pytest.fixture
def folder(fleet, dataset, tmp_path):
    """The entry of the docs beside its checkpoint."""
    return with_entry(fleet, tmp_path, dataset)


@pytest.fixture(scope="module")
def checked(fleet, dataset, tmp_path_factory):
    """The same, and the report of a check of it, as `--json` prints it."""
    place = with_entry(fleet, tmp_path_factory.mktemp("checked"), dataset)
    with (place / "checked.json").open("w") as out, contextlib.redirect_stdout(out):
        assert run(place, dataset, "--deadline", "5", "--json") == 0
    return place


def with_entry(fleet, place, dataset):
    shutil.copytree(fleet[0] / "flow", place / "flow")
    [text] = re.findall(r"```yaml\n# candidate\.yaml\n(.*?)```", DOCS.read_text(), re.DOTALL)
    digest = sha256_file(place / "flow" / "seed_0" / "model.safetensors")
    entry = yaml.safe_load(text.replace("@weights@", digest))
    assert entry["command"][0] == "genpolicy"
    entry["command"][:1] = PYTHON
    [text] = re.findall(r"```yaml\n(declared:.*?)```", DOCS.read_text(), re.DOTALL)
    manifest = dataset / "manifest.json"
    split = split_sha256(json.loads(manifest.read_bytes()))
    text = text.replace("@manifest@", sha256_file(manifest)).replace("@split@", split)
    entry |= yaml.safe_load(text)
    (place / "candidate.yaml").write_text(yaml.safe_dump(entry))
    return place


def run(folder, dataset, *words):
    return main([
        "check-candidate", str(folder / "candidate.yaml"), "--dataset", str(dataset), *words,
    ])  # fmt: skip


def change(folder, **fields):
    path = folder / "candidate.yaml"
    path.write_text(yaml.safe_dump({**yaml.safe_load(path.read_text()), **fields}))


def refused(capsys, code, expected=2):
    said = capsys.readouterr()
    assert (code, said.out) == (expected, "")
    [line] = said.err.splitlines()
    assert line.startswith("genpolicy check-candidate: ")
    return line


IN_JOINTS = """
import sys
from pathlib import Path
import numpy as np
from genpolicy.candidates.wire.connection import Listening
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.contract.action import split_action
from genpolicy.policies.policy import load_policy
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.tasks.api import load_task

task, served = load_task("tabletop_insertion"), ServedPolicy(load_policy(Path("flow/seed_0")))
arm = ArmKinematics(task.scene_path)

def answer(message):
    said = served.answer(message)
    rows = said["actions"].reshape(-1, 10)
    place, turned, opened = split_action(rows)
    seed = np.tile(task.posture_rad, (len(rows), 1))
    q = arm.solve(place, turned, q_seed_rad=seed).q_rad
    chunks = np.concatenate([q, opened[:, None]], axis=1)
    return {**said, "actions": chunks.reshape(*said["actions"].shape[:-1], 8)}

with Listening(answer, served.metadata, port=int(sys.argv[1])) as listening:
    listening.serve_forever()
"""


def test_a_server_in_joint_space_is_checked_like_any_other(folder, dataset, capsys):
    """Its joints become poses by the robot's kinematics; the docs' own lines say so."""
    [said] = re.findall(r"```yaml\n# joints\n(.*?)```", DOCS.read_text(), re.DOTALL)
    (folder / "serve.py").write_text(IN_JOINTS)
    command = [sys.executable, "serve.py", "{port}"]
    change(folder, command=command, **yaml.safe_load(said))
    assert run(folder, dataset, "--deadline", "5", "--json") == 0
    found = {one["name"]: one["judged"] for one in json.loads(capsys.readouterr().out)["findings"]}
    assert {name for name, what in found.items() if what == "holds"} == {
        "pinned", "declared", "answers", "repeats", "restarts", "seeded", "evaluations", "spans",
    }  # fmt: skip
    action = yaml.safe_load(said)["action"]
    action["joints"]["columns"] = action["joints"]["columns"][:6]
    change(folder, action=action)
    line = refused(capsys, run(folder, dataset))
    assert "6 joints, expected 7" in line


def report_of(checked):
    return json.loads((checked / "checked.json").read_text())


def test_the_docs_commands_as_written(checked, dataset, capsys):
    assert "genpolicy check-candidate candidate.yaml --earlier checked.json" in DOCS.read_text()
    # Three held-out episodes of this dataset say nothing of units, and bound no percentile.
    unknown = {
        "follows_observation", "scale", "origin", "orientation", "own_answers", "unchanged",
        "in_time", "admissible",
    }  # fmt: skip
    holds = {
        "pinned", "declared", "answers", "repeats", "restarts", "seeded", "evaluations", "spans",
    }  # fmt: skip
    assert {finding["name"]: finding["judged"] for finding in report_of(checked)["findings"]} == {
        **dict.fromkeys(holds, "holds"), **dict.fromkeys(unknown, "unknown"),
    }  # fmt: skip
    earlier = ("--deadline", "5", "--earlier", str(checked / "checked.json"))
    assert run(checked, dataset, *earlier) == 0
    said = capsys.readouterr().out
    assert "holds   B  unchanged" in said
    entry = yaml.safe_load((checked / "candidate.yaml").read_text())["declared"]
    assert f"dataset: {entry['dataset']}\nand split: {entry['split']}\n" in said
    assert "Nothing here is a gate's verdict" in said
    # A line a gate: what it will find, what nobody can tell yet, what it asks besides.
    of_b, of_c, of_d = re.findall(r"^Gate [BCD]: .*$", said, re.MULTILINE)
    assert of_b.startswith("Gate B: not known is follows_observation") and "unchanged" not in of_b
    assert "not known is in_time, admissible" in of_c or "admissible, in_time" in of_c
    assert of_d == f"Gate D: {ASKED_LATER['D']}."


def test_every_finding_of_the_docs_is_one_and_every_one_is_in_the_docs(checked):
    rows = re.findall(r"^\| (`[a-z_`, ]+`) \| ([BCD]) \|", DOCS.read_text(), re.MULTILINE)
    told = {name: gate for names, gate in rows for name in re.findall(r"`([a-z_]+)`", names)}
    assert told == {finding["name"]: finding["gate"] for finding in report_of(checked)["findings"]}


def test_another_checkpoint_behind_the_same_entry_is_told(folder, checked, fleet, dataset, capsys):
    shutil.rmtree(folder / "flow" / "seed_0")
    shutil.copytree(fleet[0] / "chunked_bc" / "seed_0", folder / "flow" / "seed_0")
    assert "the entry of my_flow" in refused(capsys, run(folder, dataset))
    change(folder, files={})
    code = run(folder, dataset, "--deadline", "5", "--earlier", str(checked / "checked.json"))
    assert code == 3
    said = capsys.readouterr().out
    assert "Refused: pinned (gate B), unchanged (gate B)." in said
    assert "Gate B: here it fails pinned, unchanged;" in said


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("candidates", 8, ("--candidates", "4")),
        ("moments", 80, ()),
        ("dataset", "0" * 64, ()),
        ("observations_sha256", "0" * 64, ()),
    ],
)
def test_answers_to_another_question_are_not_compared(
    checked, dataset, tmp_path, capsys, name, value, words
):
    report = report_of(checked)
    report["asked"][name] = value
    path = tmp_path / "checked.json"
    path.write_text(json.dumps(report))
    said = refused(capsys, run(checked, dataset, *words, "--earlier", str(path)))
    assert f"asked.{name} is {value!r}, expected " in said


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"kind": "pickle"}, "candidate.yaml.kind is 'pickle'"),
        ({"observation": {"state": {"channels": ["joints"]}}}, "is 'joints', expected a channel"),
        (
            {"horizons": {"observation_horizon": 2, "prediction_horizon": 16,
                          "execution_horizon": 8, "action_period_s": 0.1}},
            "is 0.1 s, expected 0.05 s, as in the dataset",
        ),
        ({"command": None, "address": "ws://10.0.0.1:80"}, "is 10.0.0.1, another machine"),
        ({"command": None, "address": "ws://127.0.0.1:1"}, "at fault (closed): nobody answers"),
        ({"command": ["no-such-program", "{port}"]}, "'no-such-program', which does not start"),
        ({"command": [sys.executable, "-c", "raise SystemExit('no GPU')", "{port}"]}, "no GPU"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_sentence(folder, dataset, capsys, fields, said):
    change(folder, **fields)
    if fields.get("command", "") is None:
        path = folder / "candidate.yaml"
        entry = yaml.safe_load(path.read_text())
        del entry["command"]
        path.write_text(yaml.safe_dump(entry))
    assert said in refused(capsys, run(folder, dataset))


def test_what_cannot_be_mapped_or_judged_is_refused_without_a_start(
    folder, dataset, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(checking, "Launched", lambda *_, **__: pytest.fail("it was started"))
    before = yaml.safe_load((folder / "candidate.yaml").read_text())
    anchor = {"position": ["tcp_position"], "rotation": ["tcp_rotation"]}
    change(folder, action={**before["action"], "motion": "relative", "anchor": anchor})
    assert "'tcp_position', expected a channel" in refused(capsys, run(folder, dataset))
    change(folder, **before)
    horizons = {**before["horizons"], "execution_horizon": 4}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump({"horizons": horizons}))
    monkeypatch.chdir(tmp_path)
    assert "execution_horizon 4" in refused(capsys, run(folder, dataset))


def test_what_gate_b_will_not_take_is_said(folder, dataset, capsys):
    path = folder / "candidate.yaml"
    entry = yaml.safe_load(path.read_text())
    del entry["declared"]
    path.write_text(yaml.safe_dump({**entry, "files": {}}))
    assert run(folder, dataset, "--deadline", "5") == 3
    assert "Refused: pinned (gate B), declared (gate B)." in capsys.readouterr().out


def test_no_dataset_and_no_report(folder, dataset, tmp_path, capsys):
    assert "manifest.json is not readable" in refused(capsys, run(folder, tmp_path / "none"))
    wrong = tmp_path / "wrong.json"
    wrong.write_text('{"answers_sha256": null}')
    assert "no report of a check" in refused(capsys, run(folder, dataset, "--earlier", str(wrong)))
    wrong.write_text(json.dumps({"answers_sha256": "0" * 64, "moments": 3, "candidates": 8}))
    assert "no report of a check" in refused(capsys, run(folder, dataset, "--earlier", str(wrong)))


def test_a_served_policy_says_where_it_is_and_ends_on_an_interrupt(fleet):
    checkpoint = str(fleet[0] / "flow" / "seed_0")
    # A shell starts what runs in its background deaf to interrupts, and its children inherit that.
    heard = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        server = subprocess.Popen(
            [*PYTHON, "serve-policy", checkpoint, "--port", "0"], stdout=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )  # fmt: skip
    finally:
        signal.signal(signal.SIGINT, heard)
    try:
        said = server.stdout.readline()
        [address] = re.findall(r"^Serving flow at (ws://127\.0\.0\.1:\d+)$", said)
        line = dial(address, allowed=None, timeout_s=60.0)
        assert line.metadata["method"] == "flow"
        line.close()
        server.send_signal(signal.SIGINT)
        assert server.wait() == 130
    finally:
        server.kill()
        server.wait()


def test_what_cannot_be_served(fleet, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    assert main(["serve-policy", str(tmp_path), "--device", "cuda"]) == 2
    assert "--device is 'cuda', which this machine does not have" in capsys.readouterr().err
    assert main(["serve-policy", str(tmp_path)]) == 2
    assert "config.json is not readable" in capsys.readouterr().err
    checkpoint = str(fleet[0] / "flow" / "seed_0")
    assert main(["serve-policy", checkpoint, "--sha256", "0" * 64]) == 2
    assert "a checkpoint with sha256" in capsys.readouterr().err
    with Listening(lambda message: message, {}, port=0) as taken:
        assert main(["serve-policy", checkpoint, "--port", str(taken.port)]) == 2
    assert f"--port is {taken.port}, on which nobody can listen" in capsys.readouterr().err
