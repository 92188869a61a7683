"""Stage `task` refuses a candidate that is not what it should be, before anything trains."""

import sys
from dataclasses import fields

import numpy as np
import pytest
import yaml

from gates.exceptions import utc_today
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.evidence.documents.reproducibility import (
    CANDIDATES,
    CandidateIdentity,
    IdentityCard,
)
from genpolicy.integrity.hashing import sha256_file, sha256_tree
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld
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


def _empty(kind, **known):
    """A document in which nobody has recorded anything else."""
    kinds = (("Annotated", 0), ("list", []), ("None", None), ("float", 0.0), ("str", ""))
    plain = {
        field.name: next((value for word, value in kinds if word in str(field.type)), 0)
        for field in fields(kind)
    }
    return kind(**(plain | known))


@pytest.fixture
def asked(workspace):
    """Writes the evidence of Gate B: whom it has asked, by checkpoint."""
    place = workspace / "artifacts" / "reload"
    place.mkdir(parents=True)

    def write(checkpoint):
        card = _empty(IdentityCard)
        own = _empty(CandidateIdentity, checkpoint=checkpoint, card=card)
        CANDIDATES.write(place, {"planted": own})
        return place / CANDIDATES.file

    return write


def test_one_that_gate_b_has_asked_may_have_ended_since(workspace, bring, asked, stage):
    """Nothing trains for it; what asks it again finds it silent, and what does not goes on."""
    bring(command=None, address="ws://127.0.0.1:1")
    own = read_entry(workspace / "own" / "planted.yaml").sha256
    for checkpoint, code in ((own, 0), ("0" * 64, 2)):
        asked(checkpoint)
        found, said = stage("task")
        assert (found, "where no policy answers" in said) == (code, True), said


@pytest.mark.parametrize(("damage", "told"), [
    (lambda data: data[:-40], "not JSON"),
    (lambda data: data.replace(b'"nonfinite_chunks"', b'"nonfinite_chunk"'), "unknown key"),
    (lambda data: b"[]", "a document with"),
])  # fmt: skip
def test_who_was_asked_is_not_guessed_from_a_damaged_document(
    workspace, bring, asked, stage, damage, told
):
    bring(command=None, address="ws://127.0.0.1:1")
    path = asked(read_entry(workspace / "own" / "planted.yaml").sha256)
    path.write_bytes(damage(path.read_bytes()))
    code, said = stage("task")
    assert (code, said.count("\n")) == (2, 1), said
    assert "the policy planted is silent, and whether Gate B has asked it cannot be read" in said
    assert told in said and "artifacts/reload/identity.json" in said


def test_a_task_that_does_not_do_the_same_again_stops_the_ladder(workspace, stage, monkeypatch):
    """Before anything of it is recorded, and with nothing written."""
    advance = TabletopWorld.advance

    def shaken(world, on_step=None):
        advance(world, on_step)
        world.data.qvel[0] += 1e-3 * np.random.default_rng().uniform()

    monkeypatch.setattr(TabletopWorld, "advance", shaken)
    code, said = stage("task")
    assert code == 2, said
    assert "the task tabletop_insertion: the same start and commands a second time is" in said
    assert not (workspace / "artifacts").exists()


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
