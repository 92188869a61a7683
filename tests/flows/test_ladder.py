import os
import subprocess
import sys
from pathlib import Path

import pytest

from flows import ladder
from flows.server import api_url
from flows.workspace import make_workspace
from genpolicy.errors import ConfigError


@pytest.fixture(scope="session")
def prefect_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of all flows here, one behind the other: its database is made once, which takes longest."""
    return tmp_path_factory.mktemp("prefect")


@pytest.fixture
def at_server(server: None) -> dict[str, str]:
    """The one server of this file, which takes longer to start than what is asked of it."""
    return {"PREFECT_API_URL": api_url()}


def test_stages_are_cut_behind_every_gate() -> None:
    names = ("record", "audit", "gate_a", "shadow", "gate_b")
    plan = ladder.stages_by_gate({"stages": dict.fromkeys(names)})
    assert plan == {"a": ("record", "audit", "gate_a"), "b": ("shadow", "gate_b")}
    with pytest.raises(ConfigError, match="stress behind the last gate"):
        ladder.stages_by_gate({"stages": dict.fromkeys((*names, "stress"))})


def test_an_unreachable_server_ends_the_flow_and_runs_nothing(
    checkout: Path, tmp_path: Path, prefect_home: Path
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {})
    done = _run(target, prefect_home, PREFECT_API_URL="http://127.0.0.1:9/api")
    assert done.returncode == 1
    assert "where no server answers" in done.stderr
    assert not (target / "build").exists()


def test_a_refusal_travels_through_prefect_as_code_and_sentence(
    checkout: Path, tmp_path: Path, prefect_home: Path
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {"generators": {"code": 3}})
    done = _run(target, prefect_home)
    assert done.returncode == 3, done.stderr
    last = [line for line in done.stderr.splitlines() if line.startswith("The ladder stopped")]
    assert last[0].startswith("The ladder stopped: generators: Gate A refuses: share is 0.1")
    assert (target / "build" / "runs.txt").read_text().split() == ["record", "gate_a"]
    assert "Refused(" in done.stdout + done.stderr
    assert "Retry" not in done.stdout + done.stderr


@pytest.mark.parametrize("verdict", ["FAIL", "INCONCLUSIVE"])
def test_a_gate_that_does_not_pass_is_a_failed_task_and_flow(
    checkout: Path, tmp_path: Path, prefect_home: Path, at_server: dict[str, str], verdict: str
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {"gate_a": {"verdict": verdict}})
    done = _run(target, prefect_home, **at_server)
    said = done.stdout + done.stderr
    assert done.returncode == 3, done.stderr
    assert f"The ladder stopped: gate_a: {verdict}. Return to the dataset." in done.stderr
    assert (target / "build" / "runs.txt").read_text().split() == ["record", "gate_a"]
    assert f"Finished in state {verdict}(" in said or f"{verdict}('gate_a" in said, said
    assert "Finished in state Failed(" in said, "the task of the gate is red too"


def test_a_gate_that_waits_for_people_is_complete_under_that_name(
    checkout: Path, tmp_path: Path, prefect_home: Path, at_server: dict[str, str]
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {"gate_b": {"verdict": "PENDING_REVIEW"}})
    done = _run(target, prefect_home, **at_server)
    assert done.returncode == 0, done.stderr
    assert "PENDING_REVIEW(" in done.stdout + done.stderr


def test_a_gate_e_that_waits_is_suspended_behind_a_ladder_that_is_done(
    waiting_checkout: Path, tmp_path: Path, prefect_home: Path, at_server: dict[str, str]
) -> None:
    target = make_workspace(waiting_checkout, tmp_path / "run", {})
    done = _run(target, prefect_home, **at_server)
    said = done.stdout + done.stderr
    assert done.returncode == 0, done.stderr
    assert "Finished in state Suspended(" in said and "genpolicy resume" in done.stdout
    assert (target / "build" / "runs.txt").read_text().split() == ["gate_a", "gate_e"]


def test_a_gate_e_below_which_a_gate_does_not_pass_is_not_begun(
    waiting_checkout: Path, tmp_path: Path, prefect_home: Path, at_server: dict[str, str]
) -> None:
    target = make_workspace(waiting_checkout, tmp_path / "run", {"gate_a": {"verdict": "FAIL"}})
    done = _run(target, prefect_home, **at_server)
    assert done.returncode == 3, done.stderr
    assert "gate-e" not in done.stdout + done.stderr


def _run(workspace: Path, home: Path, **variables: str) -> "subprocess.CompletedProcess[str]":
    environment = {key: value for key, value in os.environ.items() if "PREFECT" not in key}
    return subprocess.run(
        [sys.executable, "-m", "flows.ladder", "--workspace", str(workspace)],
        env={**environment, "PREFECT_HOME": str(home), **variables},
        capture_output=True,
        text=True,
        check=False,
    )
