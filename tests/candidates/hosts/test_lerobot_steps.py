"""Processors of a LeRobot folder: what would run, be fetched or lie elsewhere is not served.

The steps are those that LeRobot 0.6.1 wrote for ACT; that it imports and calls what `class` names
is `DataProcessorPipeline.from_pretrained` of the same version.
"""

import json

import pytest
import yaml

from genpolicy.candidates.hosts.forms import require_forms
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.hosts.lerobot_steps import require_steps
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.errors import BadInputError, ConfigError
from genpolicy.integrity.hashing import sha256_bytes

BEFORE, BEHIND = "policy_preprocessor.json", "policy_postprocessor.json"
STATE = "policy_preprocessor_step_3_normalizer_processor.safetensors"
STEPS = [
    {"registry_name": "rename_observations_processor", "config": {"rename_map": {}}},
    {"registry_name": "to_batch_processor", "config": {}},
    {"registry_name": "device_processor", "config": {"device": "cpu", "float_dtype": None}},
    {"registry_name": "normalizer_processor", "config": {"eps": 1e-8}, "state_file": STATE},
]


@pytest.fixture
def brought(written):
    """A function that writes a folder with such steps; gives the path of its entry."""

    def write(steps, document=BEFORE):
        path = written("lerobot")
        entry = yaml.safe_load(path.read_text())
        said = json.dumps({"name": "policy", "steps": steps}).encode()
        for name, data in ((document, said), (STATE, b"numbers")):
            (path.parent / "act" / name).write_bytes(data)
            entry["files"][f"act/{name}"] = sha256_bytes(data)
        path.write_text(yaml.safe_dump(entry))
        return path

    return write


def test_what_lerobot_writes_for_its_policies_is_let_through(brought):
    for document in (BEFORE, BEHIND):
        path = brought(STEPS, document)
        require_steps(read_entry(path), path.parent)


@pytest.mark.parametrize("document", [BEFORE, BEHIND])
@pytest.mark.parametrize(
    ("step", "told"),
    [
        ({"class": "os.system", "config": {"command": "id"}}, "the class 'os.system'"),
        ({**STEPS[1], "class": "os.system"}, "the class 'os.system'"),
        ({"registry_name": "tokenizer_processor"}, "the step 'tokenizer_processor'"),
        ({"registry_name": "relative_actions_processor"}, "the step 'relative_actions_processor'"),
        ({"registry_name": ["to_batch_processor"]}, "the step "),
        ({}, "the step None"),
        ("to_batch_processor", "the step None"),
        ({**STEPS[3], "state_file": "absent.safetensors"}, "'absent.safetensors'"),
        ({**STEPS[3], "state_file": "../act/" + STATE}, r"'\.\./act/policy"),
        ({**STEPS[3], "state_file": "./" + STATE}, r"'\./policy"),
        ({**STEPS[3], "state_file": "/dev/shm/numbers.safetensors"}, "'/dev/shm/numbers"),
        ({**STEPS[3], "state_file": None}, "None"),
    ],
)
def test_a_step_that_could_run_fetch_or_read_something_else_is_refused(
    brought, step, told, document
):
    path = brought([*STEPS, step], document)
    with pytest.raises(ConfigError, match=rf"steps\[4\].* is {told}.*kind server"):
        require_steps(read_entry(path), path.parent)


def test_it_is_refused_before_anything_trains_and_before_its_server_starts(
    brought, task, tmp_path, monkeypatch
):
    """Wrong before: the command ran when the candidate was checked, judged or proved again."""
    path = brought([{"class": "os.system", "config": {"command": "id"}}])
    entry = read_entry(path)
    (path.parent / "act" / "model.safetensors").write_bytes(b"\x02\0\0\0\0\0\0\0{}")
    (path.parent / "act" / STATE).write_bytes(b"\x02\0\0\0\0\0\0\0{}")
    with pytest.raises(ConfigError, match=r"os\.system"):
        require_forms(entry, path.parent)
    monkeypatch.chdir(tmp_path)
    (tmp_path / entry.interpreter).parent.mkdir(parents=True)
    (tmp_path / entry.interpreter).write_text("python")
    with pytest.raises(ConfigError, match=r"os\.system"):
        as_server(entry, path, task.observation)


@pytest.mark.parametrize(
    ("text", "told"), [("[]", "list of steps"), ('{"steps": {}}', "list of steps"), ("{", "JSON")]
)
def test_a_document_that_is_none_is_refused(brought, text, told):
    path = brought(STEPS)
    (path.parent / "act" / BEFORE).write_text(text)
    with pytest.raises(BadInputError, match=told):
        require_steps(read_entry(path), path.parent)
