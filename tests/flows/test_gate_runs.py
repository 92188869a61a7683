"""Stages of a gate as tasks: what is tried again, and which exit code a state stands for."""

import json

import pytest

from flows import gate_runs

# isort: split
from prefect.states import Completed, Failed, Suspended


class _State:
    def __init__(self, error: Exception) -> None:
        self.error = error

    def result(self, raise_on_failure: bool) -> Exception:
        assert not raise_on_failure
        return self.error


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (gate_runs.StageStoppedError(3, "refused", False), False),
        (gate_runs.StageStoppedError(2, "bad input", False), False),
        (gate_runs.StageStoppedError(1, "our fault", False), False),
        (gate_runs.StageStoppedError(1, "killed", True), True),
        (ValueError("something else"), False),
    ],
)
def test_only_faults_of_the_machine_are_tried_again(error: Exception, expected: bool) -> None:
    assert gate_runs.worth_a_retry(None, None, _State(error)) is expected


@pytest.mark.parametrize(
    ("state", "code"),
    [
        (Completed(), 0),
        (Completed(name="PENDING_REVIEW"), 0),
        (Suspended(), 0),
        (Failed(name="Fault"), 1),
        (Failed(name="Crashed"), 1),
        (Failed(name="Bad input"), 2),
        (Failed(name="Refused"), 3),
        (Failed(name="FAIL"), 3),
        (Failed(name="INCONCLUSIVE"), 3),
    ],
)
def test_a_state_stands_for_an_exit_code(state, code):
    assert gate_runs.exit_code(state) == code


@pytest.mark.parametrize("verdict", ["PASS", "PENDING_REVIEW", "FAIL", "INCONCLUSIVE"])
def test_without_stages_the_report_that_lies_there_still_decides(tmp_path, monkeypatch, verdict):
    """A gate whose stages are all left out may not pass by having run none."""
    monkeypatch.setattr(gate_runs, "_publish", lambda *_: None)
    (tmp_path / "reports").mkdir()
    report = json.dumps({"verdict": verdict, "decision": "Return."})
    (tmp_path / "reports" / "gate_a.json").write_text(report)
    state = gate_runs.run_gate(tmp_path, "a", [])
    assert state.is_completed() == (verdict in ("PASS", "PENDING_REVIEW"))
    assert state.message == f"gate_a: {verdict}. Return."
    assert gate_runs.exit_code(state) == (0 if state.is_completed() else 3)
