"""What runs instead: the simple policy that did best, by its checkpoint and its own success."""

import json
from types import SimpleNamespace

import evidence
import pandas as pd
import pytest

from gates.card.rollback import require_rollback, rollback_of
from gates.evidence import Evidence
from gates.proof import judge
from gates.report import read_report
from genpolicy.contract.planner import PLANNER, planner_sha256
from genpolicy.errors import IntegrityError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_file

ROLLOUTS = "stress/rollouts.parquet"


def reports(root):
    return {gate: read_report(root, gate)[0] for gate in "AD"}


def _better(frame):
    """`act` succeeds in all rollouts, and so does a candidate, which is no policy to go back to."""
    return frame.assign(success=frame["success"] | (frame["method"] == "act"))


def test_the_best_simple_policy_with_its_weights_and_its_success(ladder):
    evidence.edit_table(ladder, ROLLOUTS, _better)
    found = rollback_of(reports(ladder), Evidence(ladder))
    rollouts = evidence.STARTS * len(evidence.CONDITIONS)
    assert (found.policy, found.succeeded, found.rollouts) == ("act", rollouts, rollouts)
    weights = ladder / "artifacts/train_baselines/act/seed_0/model.safetensors"
    assert found.checkpoint_sha256 == sha256_file(weights)
    for said in ("stop, then act", found.checkpoint_sha256, f"{rollouts} of {rollouts} rollouts"):
        assert said in found.text


def test_of_equals_the_one_that_is_named_first(ladder):
    assert rollback_of(reports(ladder), Evidence(ladder)).policy == "bc"


def test_without_rollouts_or_weights_of_it_nothing_is_named(ladder):
    known = reports(ladder)
    bare = known["A"].model_copy(update={"materials": {}})
    with pytest.raises(IntegrityError, match="no weights of bc"):
        rollback_of({**known, "A": bare}, Evidence(ladder))
    evidence.edit_table(ladder, ROLLOUTS, lambda f: f[f["method"].isin(evidence.CANDIDATES)])
    with pytest.raises(IntegrityError, match="no rollout of a simple method"):
        rollback_of(known, Evidence(ladder))
    (ladder / "artifacts" / ROLLOUTS).unlink()
    with pytest.raises(IntegrityError, match="is missing"):
        rollback_of(known, Evidence(ladder))


def test_a_draft_that_names_another_rollback_is_not_of_this_chain(ladder):
    path = ladder / "artifacts/card/card.json"
    document = json.loads(path.read_text())
    assert document["rollback"] == rollback_of(reports(ladder), Evidence(ladder)).text
    document["rollback"] = "stop"
    path.write_bytes(canonical_json(document))
    evidence.record(ladder)
    [chain] = [c for c in judge(ladder, "E").criteria if c.id == "upstream_passed"]
    assert chain.verdict == "FAIL" and "the draft's rollback is 'stop'" in chain.caveat


@pytest.mark.parametrize("length", [59, 60, 61])
def test_sixty_signs_of_another_rollback_are_shown(monkeypatch, length):
    monkeypatch.setattr("gates.card.rollback.rollback_of", lambda *_: SimpleNamespace(text="y"))
    require_rollback("y", {}, None)
    with pytest.raises(IntegrityError, match=rf"rollback is 'x{{{min(length, 60)}}}', expected y"):
        require_rollback("x" * length, {}, None)


def test_the_planner_is_named_by_the_task_since_it_has_no_weights(ladder):
    def beside(frame):
        own = frame[frame["method"] == "bc"].assign(method=PLANNER, success=True, outcome="success")
        return pd.concat([frame, own], ignore_index=True)

    evidence.edit_table(ladder, ROLLOUTS, beside)
    known = reports(ladder)
    settings = known["D"].settings
    named = {**settings, "baselines": [*settings["baselines"], PLANNER]}
    known["D"] = known["D"].model_copy(update={"settings": named})
    found = rollback_of(known, Evidence(ladder))
    assert found.policy == PLANNER and found.succeeded == found.rollouts
    assert found.checkpoint_sha256 == planner_sha256(evidence.TASK["sha256"])
    (ladder / "artifacts/task/identity.json").unlink()
    with pytest.raises(IntegrityError, match="the task whose planner did best"):
        rollback_of(known, Evidence(ladder))
