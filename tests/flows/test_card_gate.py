"""Gate E as a run of its own: suspended without a card, and whoever resumes it is not believed."""

from pathlib import Path

import pytest

from flows import card_gate

# isort: split
from prefect import get_client
from prefect.client.schemas.objects import StateType
from prefect.flow_runs import resume_flow_run
from prefect.settings import PREFECT_RESULTS_PERSIST_BY_DEFAULT, temporary_settings
from prefect.states import Completed, Failed

from flows.workspace import make_workspace

pytestmark = pytest.mark.usefixtures("server")
STAGES = ("gate_a", "gate_e")
KEY = "the card is refused: signed by the unknown key abc"


@pytest.fixture
def workspace(waiting_checkout, tmp_path):
    return make_workspace(waiting_checkout, tmp_path / "run", {})


def runs_of(workspace: Path) -> list[str]:
    return (workspace / "build" / "runs.txt").read_text().split()


def with_card(workspace: Path, verdict: str) -> None:
    (workspace / "cards" / "card.txt").write_text(verdict)


def begin(workspace: Path):
    return card_gate.start_by_hand(str(workspace), STAGES)


def resumed_by_anybody(workspace: Path):
    """What the button of the interface does, and the run that follows."""
    with get_client(sync_client=True) as client:
        (run,) = card_gate.waiting(client, str(workspace))
        resume_flow_run(run.id)
        return card_gate.go_on(client.read_flow_run(run.id))


@pytest.fixture
def remembering():
    """Prefect told to keep results: a run that is resumed would be given those of before."""
    with temporary_settings({PREFECT_RESULTS_PERSIST_BY_DEFAULT: True}):
        yield


@pytest.mark.usefixtures("remembering")
def test_it_is_suspended_again_and_again_until_the_card_is_there_and_then_passes(workspace):
    state = begin(workspace)
    assert (state.type, state.name) == (StateType.PAUSED, "Suspended")
    assert runs_of(workspace) == list(STAGES)
    state = resumed_by_anybody(workspace)
    assert (state.type, state.name) == (StateType.PAUSED, "Suspended")
    with_card(workspace, "PASS")
    state = resumed_by_anybody(workspace)
    assert state.is_completed() and state.message.startswith("gate_e: PASS.")
    assert runs_of(workspace).count("gate_e") == 2, "DVC judges where the card changed, not else"
    with get_client(sync_client=True) as client:
        assert card_gate.waiting(client, str(workspace)) == []


@pytest.fixture
def quick(monkeypatch):
    """The same without DVC and its stages: a gate judges by the card that lies there."""

    def run_gate(workspace, letter, stages):
        card = workspace / "cards" / "card.txt"
        verdict = card.read_text() if card.exists() else "PENDING_REVIEW"
        state = Failed if verdict == "FAIL" else Completed
        return state(name=verdict, message=f"gate_{letter}: {verdict}. So it is.")

    monkeypatch.setattr(card_gate, "run_gate", run_gate)


def test_a_wrong_card_is_a_red_state_of_its_own_with_the_reason(workspace, quick):
    begin(workspace)
    with_card(workspace, "FAIL")
    state = resumed_by_anybody(workspace)
    assert (state.type, state.name) == (StateType.FAILED, "FAIL")
    assert state.message == "gate_e: FAIL. So it is."
    assert card_gate.told(state) == 3


def test_a_gate_that_says_pass_is_asked_what_a_signature_asks(waiting_checkout, tmp_path, quick):
    """The stage judges the bytes; `card verify` asks the history and the journals as well."""
    overrides = {"gate_e": {"asked": "FAIL"}}
    workspace = make_workspace(waiting_checkout, tmp_path / "run", overrides)
    with_card(workspace, "PASS")
    state = begin(workspace)
    assert (state.type, state.name) == (StateType.FAILED, "Refused")
    assert KEY in state.message and card_gate.told(state) == 3


def test_what_prefect_does_not_suspend_does_not_pass(workspace, quick, monkeypatch):
    monkeypatch.setattr(card_gate, "suspend_flow_run", lambda key: None)
    state = begin(workspace)
    assert (state.type, state.name) == (StateType.FAILED, "Fault")


def test_a_newer_ladder_waits_in_the_place_of_an_older_and_of_no_other_workspace(tmp_path, quick):
    first, other = tmp_path / "first", tmp_path / "other"
    with get_client(sync_client=True) as client:
        begin(other)
        begin(first)
        (older,) = card_gate.waiting(client, str(first))
        begin(first)
        (newer,) = card_gate.waiting(client, str(first))
        assert newer.id != older.id
        assert client.read_flow_run(older.id).state.type == StateType.CANCELLED
        assert len(card_gate.waiting(client, str(other))) == 1


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["FAIL: No.", "  PASS  a: x", "  FAIL  b: y"], "FAIL: No. FAIL b: y"),
        (["PENDING_REVIEW: No.", "  PASS  a: x", "  PENDING_REVIEW  c: z"],
         "PENDING_REVIEW: No. PENDING_REVIEW c: z"),
        (["Traceback:", "  in main", "ValueError: b"], "Traceback: in main ValueError: b"),
        (["a " * 5000], "a " * 998 + "..."),
        (["cards is not there, expected cards."], "cards is not there, expected cards."),
        ([], "genpolicy card verify said nothing"),
    ],
)  # fmt: skip
def test_of_what_the_card_is_refused_for_the_reason_is_said(lines, said):
    assert card_gate.refusal(lines) == said
