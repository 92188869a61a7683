"""Refused candidates, by the verdicts of a journal."""

import pytest

from genpolicy.verification.refused import KEYS, RefusedCandidates

SESSION = {"session": "s", "labels": {"method": "flow", "perturbation": "push", "start": "3"}}
REFUSED = {
    "session": "s", "chunk_id": "c", "index": 1, "first_reason": "collision",
    "layers": {"representation": True, "kinematic": True, "geometric": False, "dynamic": None},
    "measures": {"raw_sha256": "ab", "projected_sha256": "cd"},
}  # fmt: skip
PASSED = {
    **REFUSED, "first_reason": None, "layers": dict.fromkeys(REFUSED["layers"], True),
    "measures": {},
}  # fmt: skip


def read(*candidates):
    found = RefusedCandidates()
    for kind, m in (("session", SESSION), *(("candidate", one) for one in candidates)):
        found.read(kind, m)
    return found


def test_a_refused_candidate_is_a_row_and_one_that_passed_is_none():
    found = read(REFUSED, {**PASSED, "index": 2})
    (row,) = found.rows({("flow", "push", 3)})
    assert [row[name] for name in KEYS] == ["flow", "push", 3, "c", 1]
    assert (row["layer"], row["first_reason"]) == ("geometric", "collision")
    assert (row["raw_sha256"], row["projected_sha256"]) == ("ab", "cd")
    assert list(found.rows({("flow", "push", 4), ("bc", "push", 3)})) == []


def test_a_layer_that_could_not_be_evaluated_refuses_too():
    layers = {"representation": True, "kinematic": None, "geometric": None, "dynamic": None}
    (row,) = read({**REFUSED, "layers": layers}).rows({("flow", "push", 3)})
    assert row["layer"] == "kinematic"


@pytest.mark.parametrize("changes", [{"first_reason": None}, {"layers": PASSED["layers"]}])
def test_layers_and_reason_that_contradict_each_other_cannot_be_read(changes):
    with pytest.raises(ValueError, match="contradict"):
        read({**REFUSED, **changes})


def test_a_refused_candidate_without_hashes_cannot_be_read():
    with pytest.raises(KeyError, match="raw_sha256"):
        read({**REFUSED, "measures": {}})
