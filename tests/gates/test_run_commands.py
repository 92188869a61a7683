"""Commands about whole runs: what each passes on, prints, and says by its exit code."""

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from gates.run_commands import diff, plan, status


@dataclass(frozen=True)
class Found:
    """A plan, a difference or a state, as the commands see one."""

    undecidable: tuple[str, ...] = ()

    def as_document(self):
        return {"undecidable": list(self.undecidable)}


ROOT = Path("somewhere")


@pytest.fixture
def asked(monkeypatch):
    """What each part was asked, and answers that can be told apart."""
    calls = []

    def answer(name, found):
        def called(*args):
            calls.append((name, *args))
            return found

        return called

    for place, found in (
        ("gates.plan_text.plan_text", "the plan"),
        ("gates.moved.moved_text", "what moved"),
        ("gates.moved.moved", [Found(("a",))]),
        ("gates.proof.prove_all", "rungs"),
        ("gates.status.status_of", Found(("s",))),
        ("gates.status.status_text", "the state"),
    ):
        monkeypatch.setattr(place, answer(place.rpartition(".")[2], found))
    monkeypatch.setattr("gates.past.reports_of", lambda place, root: f"{place} at {root}")
    return calls


@pytest.mark.parametrize(("limits", "code"), [((), 0), (("cost",), 3), (("cost", "gain"), 3)])
@pytest.mark.parametrize("as_json", [False, True])
def test_a_plan_that_no_result_could_meet_refuses(
    asked, monkeypatch, capsys, limits, code, as_json
):
    monkeypatch.setattr("gates.planning.plan_of", lambda root: Found(limits))
    assert plan(ROOT, as_json) == code
    out = capsys.readouterr().out
    if as_json:
        assert json.loads(out) == {"undecidable": list(limits)} and not asked
    else:
        assert out == "the plan\n" and asked == [("plan_text", Found(limits))]


@pytest.mark.parametrize("as_json", [False, True])
def test_a_difference_is_of_the_first_to_the_second_and_blocks_nothing(asked, capsys, as_json):
    assert diff("old", "new", ROOT, as_json) == 0
    out = capsys.readouterr().out
    assert asked[0] == ("moved", "old at somewhere", "new at somewhere")
    if as_json:
        assert json.loads(out) == [{"undecidable": ["a"]}]
    else:
        assert out == "what moved\n" and asked[1:] == [("moved_text", [Found(("a",))])]


@pytest.mark.parametrize("as_json", [False, True])
def test_a_state_is_of_what_was_proved_now_and_blocks_nothing(asked, capsys, as_json):
    assert status(ROOT, as_json) == 0
    out = capsys.readouterr().out
    assert asked[:2] == [("prove_all", ROOT), ("status_of", ROOT, "rungs")]
    if as_json:
        assert json.loads(out) == {"undecidable": ["s"]}
    else:
        assert out == "the state\n" and asked[2:] == [("status_text", Found(("s",)))]


@pytest.mark.parametrize("command", [plan, diff, status])
def test_unless_it_is_asked_for_a_person_is_written_to(command):
    """And of the ladder that lies where the command is run."""
    root, as_json = (
        command.__wrapped__ if hasattr(command, "__wrapped__") else command
    ).__defaults__
    assert (root, as_json) == (Path(), False)
