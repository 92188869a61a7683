"""Stage `task` refuses a candidate that is not what it should be, before anything trains."""

import json
import sys

import pytest
import yaml

from gates.exceptions import utc_today
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.integrity.hashing import sha256_file, sha256_tree
from tests.candidates.conftest import ENTRY

JOINTS = {
    "motion": "absolute",
    "joints": {"columns": [0, 1, 2, 3, 4, 5], "unit": "rad"},
    "gripper": {"column": 6, "open": 1.0, "open_m": 1.0},
}

STARTED = {"address": None, "command": [sys.executable, "{port}"]}


@pytest.fixture
def bring(workspace, edit):
    """Names an entry like the planted one, with other fields, in the parameters."""
    folder = workspace / "own"
    folder.mkdir()
    (folder / "weights.bin").write_bytes(b"weights")

    def write(**changes):
        digest = sha256_file(folder / "weights.bin")
        entry = {**ENTRY, **STARTED, "files": {"weights.bin": digest}, **changes}
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
        ({"command": None, "address": "ws://192.168.0.7:8000"}, "192.168.0.7, another machine"),
        ({"command": None, "address": "nonsense"}, "'nonsense', expected ws://HOST:PORT"),
        ({"command": None, "address": "ws://127.0.0.1:1"}, "ws://127.0.0.1:1, where no policy"),
        ({"kind": "torch", "command": None, "program": "weights.bin", "stochastic": False,
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
    bring()
    assert stage("task")[0] == 0
    bring(command=["no_such_program", "{port}"])
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


def test_one_that_gate_b_has_asked_may_have_ended_since(workspace, bring, stage):
    """Nothing trains for it; what asks it again finds it silent, and what does not goes on."""
    bring(command=None, address="ws://127.0.0.1:1")
    place = workspace / "artifacts" / "reload"
    place.mkdir(parents=True)
    own = read_entry(workspace / "own" / "planted.yaml").sha256
    for checkpoint, code in ((own, 0), ("0" * 64, 2)):
        (place / "identity.json").write_text(json.dumps({"planted": {"checkpoint": checkpoint}}))
        found, said = stage("task")
        assert (found, "where no policy answers" in said) == (code, True), said


def test_the_planner_of_the_task_is_compared_or_nothing_trains(workspace, edit, stage):
    """In a rehearsal it may be left out; no ladder to a card is without it."""

    def without(params):
        params["stress"]["baselines"].remove("classical_planner")

    edit(workspace, without)
    code, said = stage("task")
    assert code == 2 and "stress.baselines is without classical_planner" in said, said
    edit(workspace, lambda params: params.update(rehearsal=True))
    code, said = stage("task")
    assert code == 0, said


def test_nobody_who_was_brought_has_the_name_of_the_planner(workspace, bring, edit, stage):
    bring(name="classical_planner")
    named = {"classical_planner": "own/planted.yaml"}
    edit(workspace, lambda params: params.update(candidates=named))
    code, said = stage("task")
    assert code == 2 and "candidates.classical_planner is a name that a trained method" in said
