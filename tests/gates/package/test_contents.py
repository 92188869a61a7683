"""What travels: all that the verdicts rest on, and nothing from elsewhere."""

import json
import shutil

import pytest
import yaml

from gates.package.contents import brought, files_of_the_run
from gates.pipeline import IGNORED
from gates.report import read_report
from genpolicy.errors import ConfigError
from genpolicy.integrity.hashing import sha256_bytes

ENTRY = {
    "name": "mine",
    "kind": "server",
    "author": "author@example.org",
    "address": "ws://127.0.0.1:1",
    "files": {"serve": sha256_bytes(b"a program")},
    "horizons": {
        "observation_horizon": 2, "prediction_horizon": 16, "execution_horizon": 8,
        "action_period_s": 0.05,
    },
    "observation": {"observation": {"channels": ["tcp_position_m"]}},
    "action": {
        "frame": "robot_base",
        "motion": "absolute",
        "position": {"columns": [0, 1, 2], "unit": "m"},
        "rotation": {"columns": [3, 4, 5, 6, 7, 8], "form": "rotation_6d"},
        "gripper": {"column": 9, "open": 1.0, "open_m": 1.0},
    },
}  # fmt: skip


def test_everything_that_a_report_names_is_carried(whole):
    files = set(files_of_the_run(whole))
    for gate in "ABCD":
        assert set(read_report(whole, gate)[0].materials) <= files
    assert {"dvc.yaml", "dvc.lock", "params.yaml", "preregistration.yaml"} <= files
    assert not any(name.startswith("build/") for name in files)


def test_cards_and_keys_stay_behind(whole):
    (whole / "cards").mkdir()
    (whole / "cards/trial.dsse.json").write_text("{}")
    assert (whole / "artifacts/card/card.json").is_file()
    assert (whole / "reviewers.yaml").is_file()
    left = ("cards/", "artifacts/card", "reviewers.yaml", "reports/gate_e")
    assert [name for name in files_of_the_run(whole) if name.startswith(left)] == []


def test_all_code_is_carried_but_what_the_interpreter_writes(whole):
    (whole / IGNORED).write_text("__pycache__\n")
    for name in ("gates/new.py", "gates/__pycache__/new.pyc", "stages/s.py"):
        (whole / name).parent.mkdir(parents=True, exist_ok=True)
        (whole / name).write_text("")
    files = set(files_of_the_run(whole))
    assert {"gates/new.py", "stages/s.py"} <= files
    assert "gates/__pycache__/new.pyc" not in files


@pytest.fixture
def own(whole):
    """A policy that was brought: its entry and its file, in a folder of its own."""
    (whole / "own").mkdir()
    (whole / "own/serve").write_bytes(b"a program")
    (whole / "own/mine.yaml").write_text(yaml.safe_dump(ENTRY))
    name(whole, "own/mine.yaml")
    return whole


def name(whole, path):
    params = yaml.safe_load((whole / "params.yaml").read_text())
    params["candidates"] = {"mine": path}
    (whole / "params.yaml").write_text(yaml.safe_dump(params))


def test_a_policy_that_was_brought_comes_with_its_entry_and_files(own):
    assert [policy.name for policy in brought(own)] == ["mine"]
    assert {"own/mine.yaml", "own/serve"} <= set(files_of_the_run(own))


def test_what_its_command_names_comes_along(own):
    """Wrong before: the script stayed behind, and an honest bundle was refused for its absence."""
    command = ["python", "serve.py", "--port={port}", "--config=flow/config.json"]
    said = {name: value for name, value in ENTRY.items() if name != "address"}
    (own / "own/mine.yaml").write_text(yaml.safe_dump({**said, "command": command}))
    (own / "own/serve.py").write_text("pass")
    (own / "own/flow").mkdir()
    (own / "own/flow/config.json").write_text("{}")
    files = set(files_of_the_run(own))
    assert {"own/mine.yaml", "own/serve", "own/serve.py", "own/flow/config.json"} <= files
    module = {**said, "command": ["python", "-m", "serve", "--port={port}"]}
    (own / "own/mine.yaml").write_text(yaml.safe_dump(module))
    assert "own/serve.py" in files_of_the_run(own)
    (own / "own/serve.py").rename(own / "own/real.py")
    (own / "own/serve.py").symlink_to("real.py")
    with pytest.raises(ConfigError, match=r"own/serve\.py, which lies .* behind a link"):
        files_of_the_run(own)


@pytest.mark.parametrize("how", ["above", "absolute", "linked"])
def test_a_policy_that_lies_elsewhere_cannot_be_carried(own, tmp_path, how):
    shutil.move(own / "own", tmp_path / "elsewhere")
    if how == "linked":
        (own / "own").symlink_to(tmp_path / "elsewhere")
    elsewhere = {"above": "../elsewhere", "absolute": str(tmp_path / "elsewhere"), "linked": "own"}
    name(own, f"{elsewhere[how]}/mine.yaml")
    with pytest.raises(ConfigError, match="outside the workspace or behind a link"):
        files_of_the_run(own)


def test_a_pipeline_that_names_what_lies_elsewhere_is_refused(whole):
    pipeline = json.loads((whole / "dvc.yaml").read_text())
    pipeline["stages"]["stress"]["deps"].append("../elsewhere")
    (whole / "dvc.yaml").write_text(json.dumps(pipeline))
    with pytest.raises(ConfigError, match=r"\.\./elsewhere, which lies outside"):
        files_of_the_run(whole)
