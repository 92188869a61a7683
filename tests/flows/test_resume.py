"""`genpolicy resume`: a card that verifies goes on, another leaves the run suspended."""

import pytest

from flows import card_gate, commands, resume

# isort: split
from prefect import get_client
from prefect.client.schemas.objects import StateType
from prefect.states import Completed

from flows.server import database
from flows.workspace import make_workspace
from genpolicy.cli.shell import run_program

pytestmark = pytest.mark.usefixtures("server")


@pytest.fixture
def workspace(waiting_checkout, tmp_path, monkeypatch):
    """Whose gate waits; its stages do not run here, the card is asked by the flow itself."""
    made = make_workspace(waiting_checkout, tmp_path / "run", {})
    card = made / "cards" / "card.txt"

    def run_gate(workspace, letter, stages):
        return Completed(name=card.read_text() if card.exists() else "PENDING_REVIEW")

    monkeypatch.setattr(card_gate, "run_gate", run_gate)
    state = card_gate.start_by_hand(str(made), ("gate_a", "gate_e"))
    assert state.is_paused()
    return made


def main(workspace) -> int:
    return run_program(commands.resume, "resume", ["--workspace", str(workspace)])


def test_a_card_that_is_missing_or_wrong_leaves_it_suspended_and_a_right_one_goes_on(
    workspace, capsys
):
    assert main(workspace) == 3
    assert "Gate E stays suspended: PENDING_REVIEW: so it is said." in capsys.readouterr().err
    card = workspace / "cards" / "card.txt"
    card.write_text("FAIL")
    assert main(workspace) == 3
    error = capsys.readouterr().err
    assert "signature_valid: the card is refused: signed by the unknown key abc" in error
    with get_client(sync_client=True) as client:
        (run,) = card_gate.waiting(client, str(workspace))
    assert run.state.name == "Suspended"
    card.write_text("PASS")
    assert main(workspace) == 0
    with get_client(sync_client=True) as client:
        assert client.read_flow_run(run.id).state.type == StateType.COMPLETED


def test_a_run_that_is_served_is_resumed_and_left_to_who_serves_it(workspace, monkeypatch, capsys):
    (workspace / "cards" / "card.txt").write_text("PASS")
    monkeypatch.setattr(resume, "BY_HAND", "another name")
    assert main(workspace) == 0
    assert "whoever serves `by-hand` runs it on" in capsys.readouterr().out
    with get_client(sync_client=True) as client:
        (run,) = card_gate.waiting(client, str(workspace))
    assert (run.state.type, run.state.name) == (StateType.SCHEDULED, "Resuming")
    monkeypatch.setattr(resume, "BY_HAND", card_gate.BY_HAND)
    assert main(workspace) == 0, "what was resumed by a click, and has nobody to run it, is run"


def test_where_nothing_waits_it_says_so(tmp_path, capsys):
    assert main(tmp_path) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"for which no run of gate E waits in {database()}" in said


def test_after_a_signature_it_is_no_fault_that_nothing_waits(tmp_path, monkeypatch, capsys):
    words = ["--workspace", str(tmp_path), "--if-waiting"]
    assert run_program(commands.resume, "resume", words) == 0
    assert "No run of gate E waits in" in capsys.readouterr().out
    monkeypatch.setattr(resume, "server_is_there", lambda: False)
    assert run_program(commands.resume, "resume", words) == 0


def test_without_the_server_that_was_named_nothing_is_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(resume, "server_is_there", lambda: False)
    assert main(tmp_path) == 1
