"""A worker that is killed under a stage: told as what it is, tried again, and the bytes the same.

The stage is a real one, `record`, with four episodes in four shards and two processes. The worker
kills itself, as the kernel does where memory runs out: no handler sees it.
"""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from flows import gate_runs
from flows.reproduce import DIED, RunEnd, _outcome, reproduce, reproduce_here
from genpolicy.integrity.hashing import sha256_tree

ROOT = Path(__file__).parents[2]
EPISODES = 4

# Dask carries what is defined in the main module to its workers by value.
STAGE = """
import os, pathlib, runpy, signal
from genpolicy.tasks import demonstrations

of_each, died = demonstrations.map_shards, pathlib.Path("build/died").resolve()


def map_shards(function, shards, **how):
    last = shards[-1].specs

    def killed(shard):
        if shard.specs == last and len(died.read_text()) < 2:
            died.write_text(died.read_text() + "x")
            os.kill(os.getpid(), signal.SIGKILL)
        return function(shard)

    return of_each(killed, shards, **how)


if __name__ == "__main__":
    demonstrations.map_shards = map_shards
    runpy.run_module("stages.record", run_name="__main__")
"""


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One stage, the last shard of which kills its worker at the first two tries."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    folder = tmp_path / "run"
    (folder / ".dvc").mkdir(parents=True)
    (folder / ".dvc" / "config").write_text("[core]\n    analytics = false\n    no_scm = true\n")
    (folder / "build").mkdir()
    (folder / "build" / "died").touch()
    (folder / "stage.py").write_text(STAGE)
    (folder / "dvc.yaml").write_text(
        "stages:\n  record:\n    cmd: python stage.py\n    outs: [artifacts/record]\n"
    )
    write_params(folder, workers=2)
    return folder


def write_params(folder: Path, *, workers: int) -> None:
    """Those of the checkout, with few episodes and so many local processes."""
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    params["record"]["episodes"] = EPISODES
    params["compute"] = {**params["compute"], "workers": workers, "scheduler": "local"}
    (folder / "params.yaml").write_text(yaml.safe_dump(params))


def undisturbed(folder: Path) -> dict[str, str]:
    """What the stage writes in one process, where nothing dies."""
    folder.mkdir()
    write_params(folder, workers=1)
    subprocess.run([sys.executable, "-m", "stages.record"], cwd=folder, check=True)
    return sha256_tree(folder / "artifacts" / "record")


def test_a_killed_worker_is_told_tried_again_and_leaves_the_bytes_of_an_undisturbed_run(
    workspace: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """By the flow, which would retry what is told of the first try; then by the command, alone."""
    outcome = reproduce(workspace, stages=["record"], single_item=True, echo=print)
    assert "BrokenProcessPool" in capfd.readouterr().out, "a worker died for real"
    assert (outcome.code, outcome.stage, outcome.worker_died) == (1, "record", True)
    stopped = gate_runs.StageStoppedError(outcome.code, outcome.sentence, outcome.infrastructure)
    assert gate_runs.worth_a_retry(None, None, Ended(stopped))
    assert not (workspace / "artifacts" / "record").exists(), "nothing half written"

    assert reproduce_here(workspace, stages=["record"], single_item=True) == 0
    said = capfd.readouterr().err
    assert "record: a worker process died under the stage" in said and "Run again, once." in said
    assert "The ladder stopped" not in said
    assert (workspace / "build" / "died").read_text() == "xx", "one at the first try and the second"
    written = workspace / "artifacts" / "record"
    assert len(list((written / "episodes").iterdir())) == EPISODES
    assert sha256_tree(written) == undisturbed(tmp_path / "alone")


def test_a_worker_that_dies_again_ends_the_ladder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tries = []

    def dead(workspace: Path, **_: object) -> RunEnd:
        tries.append(workspace)
        return RunEnd(1, "x", f"x: {DIED}", True, 1.0, worker_died=True)

    (tmp_path / "dvc.yaml").write_text("stages: {}\n")
    monkeypatch.setattr("flows.reproduce.reproduce", dead)
    monkeypatch.setattr("flows.reproduce.signal.signal", lambda *_: None)
    assert reproduce_here(tmp_path, stages=["x"]) == 1
    said = capsys.readouterr().err
    assert len(tries) == 2 and said.count("Run again, once.") == 1
    assert "The ladder stopped: x: a worker process died under the stage" in said


class Ended:
    """The state of a task that raised."""

    def __init__(self, error: Exception) -> None:
        self.error = error

    def result(self, raise_on_failure: bool) -> Exception:
        return self.error


BROKEN = "concurrent.futures.process.BrokenProcessPool: A process in the pool was terminated."
OURS = "x: this is a fault of genpolicy, not of your input. Report the lines above."
FAILED = "ERROR: failed to reproduce 'x': failed to run: python -m stages.x, exited with 1"


@pytest.mark.parametrize(
    ("before", "died"),
    [
        ([BROKEN], True),
        ([BROKEN, ""], True),
        (["distributed.scheduler.KilledWorker: Attempted to run task f on 4 workers"], True),
        (["BrokenProcessPool: A child process terminated abruptly"], True),
        ([BROKEN, "", "During handling", "KeyError: 'x'"], False),
        (["ValueError: BrokenProcessPool is a word"], False),
        ([], False),
    ],
)
def test_only_the_last_word_of_a_traceback_says_that_a_worker_died(
    before: list[str], died: bool
) -> None:
    outcome = _outcome(255, [*before, OURS, FAILED], 1.0)
    assert (outcome.code, outcome.worker_died, outcome.infrastructure) == (1, died, died)
    assert ("fault of genpolicy" in outcome.sentence) != died


def test_a_refusal_that_speaks_of_a_dead_worker_is_a_refusal() -> None:
    refused = FAILED.removesuffix("1") + "3"
    outcome = _outcome(255, [BROKEN, "x: Gate A refuses.", refused], 1.0)
    assert (outcome.code, outcome.worker_died, outcome.infrastructure) == (3, False, False)
