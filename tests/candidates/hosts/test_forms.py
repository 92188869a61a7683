"""Forms of files that are read and never run."""

import json

import numpy as np
import pytest
from safetensors.numpy import save

from genpolicy.candidates.hosts.forms import require_forms
from genpolicy.candidates.hosts.kinds import LeRobotEntry, ScriptedEntry
from genpolicy.errors import ConfigError
from tests.candidates.conftest import ENTRY

COMMON = {name: value for name, value in ENTRY.items() if name not in ("address", "kind")}


@pytest.fixture
def scripted():
    return ScriptedEntry.model_validate(
        {**COMMON, "kind": "scripted", "function": "planner:plan", "stochastic": False}
    )


@pytest.fixture
def lerobot(tmp_path):
    (tmp_path / "config.json").write_text(json.dumps({"type": "act"}))
    (tmp_path / "model.safetensors").write_bytes(save({"w": np.zeros(2)}))
    return LeRobotEntry.model_validate({**COMMON, "kind": "lerobot", "pretrained_model": "."})


@pytest.mark.parametrize(
    "source",
    [
        "def plan(given): ...",
        "from numpy import zeros as plan",
        "plan = lambda given: given",
        "try:\n    import planner_in_c as plan\nexcept ImportError:\n    def plan(given): ...",
        "class plan: ...",
    ],
)
def test_a_function_by_whatever_binds_its_name(scripted, tmp_path, source):
    (tmp_path / "planner.py").write_text(source)
    require_forms(scripted, tmp_path)


@pytest.mark.parametrize(
    ("source", "told"),
    [
        (b"def plans(given): ...", "without the function plan"),
        (b"def outer():\n    def plan(given): ...", "without the function plan"),
        (b"print(plan)", "without the function plan"),
        (b"def plan(given: ...", "no Python module"),
        (b"\xff\xfe", "no Python module"),
        (b"plan = 1\x00", "no Python module"),
    ],
)
def test_a_module_without_it(scripted, tmp_path, source, told):
    (tmp_path / "planner.py").write_bytes(source)
    with pytest.raises(ConfigError, match=rf"planner\.py is .*{told}"):
        require_forms(scripted, tmp_path)


@pytest.mark.parametrize(
    ("name", "data", "told"),
    [
        ("config.json", b"type: act", "not JSON"),
        ("config.json", b"[]", "JSON of type list"),
        ("policy_preprocessor.json", b"{", "not JSON"),
        ("model.safetensors", b"x", "no file of tensors"),
    ],
)
def test_a_folder_of_lerobot(lerobot, tmp_path, name, data, told):
    require_forms(lerobot, tmp_path)
    (tmp_path / name).write_bytes(data)
    with pytest.raises(ConfigError, match=rf"{name} is .*{told}"):
        require_forms(lerobot, tmp_path)
