"""A ladder that is killed and started again ends at the same bytes; two writers never meet."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from ladder_workspace import half_written, hashes, repro, run_stage

from flows.reproduce import stage_environment

# Stage, and the seconds after which its process group is killed: the interpreter's start, the
# reading, the work, the writing. Drawn once; the last ones are near the end on a quick machine.
KILLS_PER_STAGE = 2
DVC_STARTS_S = 2.0
STAGES = (
    "ingest",
    pytest.param("audit", marks=pytest.mark.long),
    pytest.param("gate_a", marks=pytest.mark.long),
    pytest.param("shadow", marks=pytest.mark.long),
)


def start(workspace: Path, stage: str) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        [sys.executable, "-m", "dvc", "repro", "--force", "--single-item", stage],
        cwd=workspace,
        env=stage_environment(workspace),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def kill_group(process: "subprocess.Popen[bytes]") -> None:
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def child_of(process: "subprocess.Popen[bytes]", stage: str) -> int:
    """The stage's interpreter, waited for."""
    while process.poll() is None:
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                command = (folder / "cmdline").read_bytes().split(b"\0")
                group = os.getpgid(int(folder.name))
            except (OSError, ProcessLookupError):
                continue
            if group == process.pid and f"stages.{stage}".encode() in command:
                return int(folder.name)
        time.sleep(0.05)
    pytest.fail(f"stage {stage} did not start")


def wait_for_writer(workspace: Path, stage: str, process: "subprocess.Popen[bytes]") -> None:
    """Until the stage has opened its temporary folder; earlier dead ones do not count."""
    artifacts = workspace / "artifacts"
    dead = set(artifacts.glob(f".{stage}.tmp.*"))
    while not set(artifacts.glob(f".{stage}.tmp.*")) - dead:
        assert process.poll() is None, f"{stage} never wrote"
        time.sleep(0.01)


@pytest.mark.parametrize("stage", STAGES)
def test_killed_at_random_times_and_run_again_gives_the_same_bytes(copy: Path, stage: str) -> None:
    before = hashes(copy, "artifacts", "reports")
    measured = json.loads((copy / "build" / "times" / f"{stage}.json").read_text())
    whole_s = DVC_STARTS_S + measured["seconds"]
    times = random.Random(f"kill {stage}")
    killed = 0
    for number in range(KILLS_PER_STAGE):
        process = start(copy, stage)
        # The first while the output is certainly open, the others anywhere.
        if number == 0 and not stage.startswith("gate_"):
            wait_for_writer(copy, stage, process)
            time.sleep(times.uniform(0.0, 0.3))
        else:
            time.sleep(times.uniform(0.2, 0.95) * whole_s)
        killed += process.poll() is None
        if process.poll() is None:
            kill_group(process)
        left = hashes(copy, f"artifacts/{stage}")
        same = {name: before[name] for name in left}
        assert left == same, "a killed writer left something else under the true name"
    assert killed >= 1
    # Forced, because DVC would otherwise restore the outputs from its cache instead of running.
    outcome, ran = repro(copy, stage, single_item=True, force=True)
    assert (outcome.code, ran) == (0, [stage]), outcome.sentence
    assert half_written(copy) == [], "the next run of the stage clears what the dead one left"
    assert hashes(copy, "artifacts", "reports") == before


def test_a_stage_that_outlives_its_dvc_keeps_a_second_writer_out(copy: Path) -> None:
    before = hashes(copy, "artifacts")
    process = start(copy, "ingest")
    child = child_of(process, "ingest")
    wait_for_writer(copy, "ingest", process)
    os.kill(child, signal.SIGSTOP)  # so that it is certainly still there
    try:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        outcome, _ = repro(copy, "ingest", single_item=True, force=True)
        assert (outcome.code, outcome.stage) == (2, "ingest")
        assert "held by another process that writes the same folder" in outcome.sentence
        code, said = run_stage(copy, "ingest")
        assert code == 2 and "one writer at a time" in said
    finally:
        os.kill(child, signal.SIGCONT)
    while Path(f"/proc/{child}").exists():
        if b"Z (zombie)" in Path(f"/proc/{child}/status").read_bytes():
            break
        time.sleep(0.1)
    assert hashes(copy, "artifacts") == before, "the one that outlived wrote its whole result"
    outcome, _ = repro(copy, "ingest")
    assert outcome.code == 0, outcome.sentence
    assert hashes(copy, "artifacts") == before


def test_an_unforced_repro_goes_on_after_a_death(copy: Path) -> None:
    """It neither meets the locks of the dead nor believes what they left half written."""
    before = hashes(copy, "artifacts", "reports")
    process = start(copy, "ingest")
    wait_for_writer(copy, "ingest", process)
    kill_group(process)
    assert half_written(copy), "it was killed while it wrote"
    assert not (copy / "artifacts" / "ingest").exists()
    outcome, _ = repro(copy)
    assert outcome.code == 0, outcome.sentence
    after = hashes(copy, "artifacts", "reports", leave=("artifacts/.ingest",))
    assert after == before
