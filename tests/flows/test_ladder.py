import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from flows import ladder
from flows.judged import judged
from flows.workspace import make_workspace
from genpolicy.errors import BadInputError, ConfigError


def test_stages_are_cut_behind_every_gate() -> None:
    names = ("record", "audit", "gate_a", "shadow", "gate_b")
    plan = ladder.stages_by_gate({"stages": dict.fromkeys(names)})
    assert plan == {"a": ("record", "audit", "gate_a"), "b": ("shadow", "gate_b")}
    with pytest.raises(ConfigError, match="stress behind the last gate"):
        ladder.stages_by_gate({"stages": dict.fromkeys((*names, "stress"))})


class _State:
    def __init__(self, error: Exception) -> None:
        self.error = error

    def result(self, raise_on_failure: bool) -> Exception:
        assert not raise_on_failure
        return self.error


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (ladder.StageStoppedError(3, "refused", False), False),
        (ladder.StageStoppedError(2, "bad input", False), False),
        (ladder.StageStoppedError(1, "our fault", False), False),
        (ladder.StageStoppedError(1, "killed", True), True),
        (ValueError("something else"), False),
    ],
)
def test_only_faults_of_the_machine_are_tried_again(error: Exception, expected: bool) -> None:
    assert ladder.worth_a_retry(None, None, _State(error)) is expected


def test_a_silent_server_is_given_up_once_and_a_slow_one_is_not() -> None:
    given_up = threading.Event()
    started = time.monotonic()
    calls: list[str] = []

    def give_up(url: str) -> None:
        calls.append(url)
        given_up.set()

    with ladder.watch_server(
        "u", silence_s=0.3, period_s=0.02, answers=lambda _: False, give_up=give_up
    ):
        assert given_up.wait(10)
        assert time.monotonic() - started >= 0.3
        time.sleep(0.1)
    assert calls == ["u"]

    answers = iter([False, False, True] * 1000)
    calls.clear()
    with ladder.watch_server(
        "u", silence_s=0.5, period_s=0.02, answers=lambda _: next(answers), give_up=calls.append
    ):
        time.sleep(1.0)
    assert calls == []


def test_the_limits_on_silence_leave_a_minute_untouched() -> None:
    assert ladder.SILENCE_S + ladder.PROBE_PERIOD_S + ladder.FIRST_ANSWER_S < 60


def test_an_unreachable_server_ends_the_flow_and_runs_nothing(
    checkout: Path, tmp_path: Path
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {})
    done = _run(target, tmp_path, PREFECT_API_URL="http://127.0.0.1:9/api")
    assert done.returncode == 1
    assert "where no server answers" in done.stderr
    assert not (target / "build").exists()


def test_a_refusal_travels_through_prefect_as_code_and_sentence(
    checkout: Path, tmp_path: Path
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {"generators": {"code": 3}})
    done = _run(target, tmp_path)
    assert done.returncode == 3, done.stderr
    last = [line for line in done.stderr.splitlines() if line.startswith("The ladder stopped")]
    assert last[0].startswith("The ladder stopped: generators: Gate A refuses: share is 0.1")
    assert (target / "build" / "runs.txt").read_text().split() == ["record", "gate_a"]
    assert "Refused(" in done.stdout + done.stderr
    assert "Retry" not in done.stdout + done.stderr


@pytest.mark.parametrize("verdict", ["FAIL", "INCONCLUSIVE"])
def test_a_gate_that_does_not_pass_is_a_failed_task_and_flow(
    checkout: Path, tmp_path: Path, verdict: str
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {"gate_a": {"verdict": verdict}})
    done = _run(target, tmp_path)
    said = done.stdout + done.stderr
    assert done.returncode == 3, done.stderr
    assert f"The ladder stopped: gate_a: {verdict}. Return to the dataset." in done.stderr
    assert (target / "build" / "runs.txt").read_text().split() == ["record", "gate_a"]
    assert f"Finished in state {verdict}(" in said or f"{verdict}('gate_a" in said, said
    assert "Finished in state Failed(" in said, "the task of the gate is red too"


def test_a_gate_that_waits_for_people_is_complete_under_that_name(
    checkout: Path, tmp_path: Path
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {"gate_b": {"verdict": "PENDING_REVIEW"}})
    done = _run(target, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "PENDING_REVIEW(" in done.stdout + done.stderr


@pytest.mark.parametrize("text", ["{}", "[]", '{"verdict": 1}'])
def test_a_gate_without_a_verdict_is_bad_input(tmp_path: Path, text: str) -> None:
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports" / "gate_a.json").write_text(text)
    with pytest.raises(BadInputError, match="without a verdict"):
        judged(tmp_path, "gate_a")


def _run(workspace: Path, home: Path, **variables: str) -> "subprocess.CompletedProcess[str]":
    environment = {key: value for key, value in os.environ.items() if "PREFECT" not in key}
    return subprocess.run(
        [sys.executable, "-m", "flows.ladder", "--workspace", str(workspace)],
        env={**environment, "PREFECT_HOME": str(home / "prefect"), **variables},
        capture_output=True,
        text=True,
        check=False,
    )
