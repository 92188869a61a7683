"""Stage `task` refuses a candidate that is not what it should be, before anything trains."""

import sys

import pytest
import yaml

from gates.exceptions import utc_today
from genpolicy.integrity.hashing import sha256_file, sha256_tree
from tests.candidates.conftest import ENTRY

JOINTS = {
    "motion": "absolute",
    "joints": {"columns": [0, 1, 2, 3, 4, 5], "unit": "rad"},
    "gripper": {"column": 6, "open": 1.0, "open_m": 1.0},
}


@pytest.fixture
def bring(workspace, edit):
    """Names an entry like the planted one, with other fields, in the parameters."""
    folder = workspace / "own"
    folder.mkdir()
    (folder / "weights.bin").write_bytes(b"weights")

    def write(**changes):
        digest = sha256_file(folder / "weights.bin")
        entry = {**ENTRY, "files": {"weights.bin": digest}, **changes}
        entry = {name: value for name, value in entry.items() if value is not None}
        (folder / "planted.yaml").write_text(yaml.safe_dump(entry))
        edit(workspace, lambda params: params["candidates"].update(planted="own/planted.yaml"))
        return entry

    return write


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"name": "another"}, "the entry of another"),
        ({"files": {"weights.bin": "0" * 64}}, "or write the hash of what it is now into `files`"),
        ({"observation": {"state": {"channels": ["tcp_pose"]}}}, "'tcp_pose', expected a channel"),
        ({"action": JOINTS}, "6 joints, expected 7"),
        ({"address": "ws://192.168.0.7:8000"}, "192.168.0.7, another machine"),
        ({"address": "nonsense"}, "'nonsense', expected ws://HOST:PORT"),
        ({"kind": "torch", "address": None, "program": "weights.bin", "stochastic": False,
          "start_timeout_s": 300.0},
         "refused by its host"),
    ],
)  # fmt: skip
def test_a_candidate_is_looked_at_before_anything_trains(workspace, bring, stage, changes, told):
    bring()
    code, said = stage("task")
    assert code == 0, said
    before = sha256_tree(workspace / "artifacts")
    bring(**changes)
    code, said = stage("task")
    assert code == 2, said
    assert said.splitlines()[-1].startswith("task: ") and told in said
    assert sha256_tree(workspace / "artifacts") == before


def test_a_program_that_this_machine_does_not_have(workspace, bring, stage):
    bring(address=None, command=[sys.executable, "{port}"])
    assert stage("task")[0] == 0
    bring(address=None, command=["no_such_program", "{port}"])
    code, said = stage("task")
    assert code == 2 and "no_such_program" in said


@pytest.mark.parametrize(("name", "expires", "told"), [
    ("planted", "2020-01-01", "params.yaml: gate_b.unmatched.planted is over since 2020-01-01"),
    ("planted", "9999-12-31", "expected a last day at most 90 days from"),
    ("flow", str(utc_today()), "an exception of nobody who was brought, expected one of planted"),
])  # fmt: skip
def test_an_exception_is_read_before_anything_trains(
    workspace, bring, edit, stage, name, expires, told
):
    bring()

    def write(name, expires):
        entry = {"owner": "model", "reason": "trained by its maker", "expires": expires}
        edit(workspace, lambda params: params["gate_b"].update(unmatched={name: entry}))

    write("planted", str(utc_today()))
    code, said = stage("task")
    assert code == 0, said
    write(name, expires)
    code, said = stage("task")
    assert code == 2 and told in said, said
