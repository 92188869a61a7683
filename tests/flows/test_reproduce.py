"""Driving `dvc repro`: refusals, faults of the machine, and interrupts."""

import importlib.util
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flows import commands
from flows.reproduce import _outcome, reproduce, reproduce_here, stop_group
from flows.workspace import make_workspace
from genpolicy.cli.shell import run_program


def main(arguments: list[str]) -> int:
    return run_program(commands.reproduce, "reproduce", arguments)


def runs(workspace: Path) -> list[str]:
    file = workspace / "build" / "runs.txt"
    return file.read_text().split() if file.exists() else []


def test_a_ladder_runs_once_stops_at_a_refusal_and_goes_on_when_it_is_lifted(
    checkout: Path, tmp_path: Path
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {"generators": {"code": 3}})
    printed: list[str] = []
    outcome = reproduce(target, echo=printed.append)
    assert (outcome.code, outcome.stage, outcome.infrastructure) == (3, "generators", False)
    assert outcome.sentence.startswith("generators: Gate A refuses: share is 0.1, required >= 0.5")
    assert runs(target) == ["record", "gate_a"]
    assert (target / "reports" / "gate_a.md").exists()
    assert any("Gate A refuses" in line for line in printed)

    make_workspace(checkout, target, {})
    assert reproduce(target, echo=lambda _: None).code == 0
    assert runs(target) == ["record", "gate_a", "generators", "gate_b"]
    assert reproduce(target, echo=lambda _: None).code == 0
    assert runs(target) == ["record", "gate_a", "generators", "gate_b"]


@pytest.mark.parametrize(
    ("verdict", "code"), [("FAIL", 3), ("INCONCLUSIVE", 3), ("PENDING_REVIEW", 0), ("PASS", 0)]
)
def test_the_last_gate_has_no_stage_behind_it_and_is_asked_itself(
    checkout: Path,
    tmp_path: Path,
    verdict: str,
    code: int,
    capfd: pytest.CaptureFixture[str],
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {"gate_b": {"verdict": verdict}})
    assert main(["--workspace", str(target)]) == code
    said = f"The ladder stopped: gate_b: {verdict}. Return to the dataset."
    assert (said in capfd.readouterr().err) == (code == 3)
    outcome = reproduce(target, echo=lambda _: None)  # nothing is left to run, the answer stands
    judged = ("gate_b", verdict) if code else ("", "")
    assert (outcome.code, outcome.stage, outcome.verdict) == (code, *judged)
    assert not outcome.infrastructure
    assert reproduce(target, stages=("gate_b",), echo=lambda _: None).code == 0


def test_a_gate_in_the_middle_is_asked_by_the_stage_behind_it(
    checkout: Path, tmp_path: Path
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {"gate_a": {"verdict": "FAIL"}})
    assert reproduce(target, echo=lambda _: None).code == 0


def test_a_file_that_no_stage_wrote_stops_the_ladder_before_dvc_removes_it(
    checkout: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """DVC empties an output both when it runs a stage and when it brings back what it wrote."""
    target = make_workspace(checkout, tmp_path / "run", {})
    assert reproduce(target, echo=lambda _: None).code == 0
    mine = target / "artifacts" / "generators" / "notes.txt"
    mine.write_text("mine")
    for value in (1, 2):
        make_workspace(checkout, target, {"generators": {"value": value}})
        assert main(["--workspace", str(target)]) == 2
        assert "artifacts/generators/notes.txt is a file that" in capfd.readouterr().err
        assert mine.read_text() == "mine" and len(runs(target)) == 4
    mine.rename(tmp_path / "notes.txt")
    (target / "artifacts" / "record" / "value.txt").write_text("edited")  # what DVC repairs
    assert main(["--workspace", str(target)]) == 0
    assert (target / "artifacts" / "generators" / "value.txt").read_text() == "2"


@pytest.mark.parametrize(
    "broken",
    [
        "stages: [",
        "stages:\n  x:\n    comand: y\n",
        "stages:\n  x: {cmd: 'true', deps: [absent]}\n",
    ],
)
def test_a_broken_pipeline_is_bad_input(
    checkout: Path, tmp_path: Path, broken: str, capfd: pytest.CaptureFixture[str]
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {})
    (target / "dvc.yaml").write_text(broken)
    assert main(["--workspace", str(target)]) == 2
    assert "The ladder stopped: " in capfd.readouterr().err


FAILED = "ERROR: failed to reproduce 'x': failed to run: python -m stages.x, exited with {}"


@pytest.mark.parametrize(
    ("lines", "code", "infrastructure"),
    [
        ([FAILED.format(-9)], 1, True),
        ([FAILED.format(137)], 1, True),
        (["x: OSError: [Errno 28] No space left on device", FAILED.format(1)], 1, True),
        (["x: f is not writable (No space left on device)", FAILED.format(2)], 2, True),
        ([FAILED.format(1)], 1, False),
        ([FAILED.format(2)], 2, False),
        (["ERROR: Unable to acquire lock. Most likely another DVC process is running"], 1, True),
        (["ERROR: 'dvc.yaml' is invalid."], 2, False),
        (["ERROR: unexpected error - boom"], 1, False),
        ([], 1, False),
    ],
)
def test_faults_of_the_machine_are_told_from_answers(
    lines: list[str], code: int, infrastructure: bool
) -> None:
    outcome = _outcome(255, lines, 1.0)
    assert (outcome.code, outcome.infrastructure) == (code, infrastructure)
    assert outcome.sentence


def test_a_stop_ends_the_stage_that_dvc_started_too(tmp_path: Path) -> None:
    file = tmp_path / "child.pid"
    script = (
        "import subprocess, sys, pathlib, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
        f"pathlib.Path({str(file)!r}).write_text(str(child.pid))\n"
        "time.sleep(60)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script], start_new_session=True, text=True)
    while not (file.exists() and file.read_text()):
        assert process.poll() is None
        time.sleep(0.05)
    stop_group(process)
    time.sleep(0.2)
    assert process.poll() is not None
    status = Path(f"/proc/{file.read_text()}/status")
    assert not status.exists() or "zombie" in status.read_text()


def test_who_interrupts_the_ladder_reads_the_code_of_an_interrupt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stopped(workspace: Path, **_: object) -> None:
        raise KeyboardInterrupt

    (tmp_path / "dvc.yaml").write_text("stages: {}\n")
    monkeypatch.setattr("flows.reproduce.reproduce", stopped)
    monkeypatch.setattr("flows.reproduce.signal.signal", lambda *_: None)
    assert reproduce_here(tmp_path, stages=["gate_a"]) == 130
    assert "DVC and its stage were stopped" in capsys.readouterr().err


def test_driving_the_ladder_without_a_server_does_not_load_prefect() -> None:
    assert importlib.util.find_spec("prefect") is not None
    modules = "flows.reproduce, flows.workspace, flows.commands"
    code = f"import sys, {modules}; sys.exit('prefect' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], env=dict(os.environ), check=True)
