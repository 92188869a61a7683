"""`genpolicy card`: from a key and the draft to a card that can be signed, as a person types it."""

import io
import json
import re

import pytest
import yaml

from gates.card.commands import card
from gates.card.people import ROLES, Person
from gates.card.signing import read_draft
from genpolicy.cli.shell import run_program
from genpolicy.integrity.documents import canonical_json

TODAY = "2026-11-21"
ASKED = ["30", "measured here", "sam", "hand button to drive enable", "rita", "", "2026-11-30"]


@pytest.fixture
def run(team, capsys, monkeypatch):
    """A command on the ladder: exit code, standard output, standard error."""
    monkeypatch.setattr("gates.exceptions.utc_today", lambda: __import__("team").TODAY)

    def run(*words, typed=None):
        if typed is not None:
            terminal = io.StringIO("".join(f"{line}\n" for line in typed))
            terminal.isatty = lambda: True
            monkeypatch.setattr("sys.stdin", terminal)
        code = run_program(card, "genpolicy card", [*map(str, words), "--root", str(team.root)])
        said = capsys.readouterr()
        return code, said.out, said.err

    return run


def answers(*leave_out, **changes):
    given = {
        "force_limit_n": "30", "force_limit_reason": "measured here", "spotter": "sam",
        "stop_path": "hand button", "reviewer": "rita", "expires": "2026-11-30", **changes,
    }  # fmt: skip
    pairs = [f"{name}={said}" for name, said in given.items() if name not in leave_out]
    return [word for pair in pairs for word in ("--set", pair)]


def test_a_key_and_the_entry_that_names_it(run, tmp_path):
    code, out, _ = run("keygen", "--id", "rita", "--out", tmp_path / "rita.pem")
    assert code == 0
    [entry] = yaml.safe_load(out[out.index("- id:") :])
    assert all(role in out for role in ROLES)  # nobody has to look up what to write there
    person = Person(**{**entry, "name": "Rita", "role": "reviewer", "emails": ()})
    assert person.key is not None
    assert "PRIVATE" not in out
    assert (tmp_path / "rita.pem").is_file()


def test_no_key_for_an_id_that_the_list_would_refuse(run, tmp_path):
    code, _, err = run("keygen", "--id", "Rita R.", "--out", tmp_path / "rita.pem")
    assert code == 2
    assert "--id is 'Rita R.'" in err
    assert not (tmp_path / "rita.pem").exists()


def test_a_card_is_filled_from_options_without_a_terminal(run, team, tmp_path):
    code, out, err = run("fill", "--out", tmp_path / "card.json", *answers(), typed=None)
    assert (code, err) == (0, "")
    written = json.loads((tmp_path / "card.json").read_text())
    draft = read_draft(team.root)
    assert written["spotter"] == "sam"
    assert written["caveats"] == list(draft.caveats)
    assert all(f"- {caveat}" in out for caveat in draft.caveats)


def test_without_a_terminal_nothing_is_asked_and_nothing_is_written(run, tmp_path):
    code, _, err = run("fill", "--out", tmp_path / "card.json", *answers("spotter"))
    assert code == 2
    assert "the card's spotter is not answered, expected who stands at the stop" in err
    assert not (tmp_path / "card.json").exists()


def test_a_person_is_asked_until_the_answer_holds(run, team, tmp_path):
    thresholds = len(read_draft(team.root).abort_thresholds)
    typed = ["500", *ASKED[:4], "ada", *ASKED[4:6], "2030-01-01", ASKED[6], *[""] * thresholds]
    code, out, err = run("fill", "--out", tmp_path / "card.json", typed=typed)
    assert code == 0, err
    assert [line.partition(" is ")[0] for line in err.splitlines() if "the card's" in line] == [
        "the card's force_limit_n", "the card's reviewer", "the card's expires",
    ]  # fmt: skip
    written = json.loads((tmp_path / "card.json").read_text())
    assert (written["force_limit_n"], written["reviewer"]) == (30.0, "rita")
    assert written["abort_thresholds"] == read_draft(team.root).abort_thresholds
    assert re.search(r"force_limit_n: contact force that ends the trial, N", out)


def test_what_was_given_is_not_asked_again(run, team, tmp_path):
    thresholds = len(read_draft(team.root).abort_thresholds)
    typed = ["", *[""] * thresholds]
    code, out, _ = run("fill", "--out", tmp_path / "card.json", *answers(), typed=typed)
    assert code == 0
    assert "who stands at the stop" not in out


def test_of_a_draft_that_nobody_can_complete_nothing_is_asked(run, team, tmp_path):
    """With the authors that params.yaml ships, which are none, no answer would ever hold."""
    path = team.root / "artifacts/card/card.json"
    path.write_bytes(canonical_json({**json.loads(path.read_bytes()), "authors": []}))
    code, out, err = run("fill", "--out", tmp_path / "card.json", typed=ASKED)
    assert code == 2 and "force_limit_n" not in out
    assert "the card's authors is empty in the draft" in err and "card.authors" in err


def test_an_old_card_is_not_replaced(run, tmp_path):
    (tmp_path / "card.json").write_text("signed by hand")
    code, _, err = run("fill", "--out", tmp_path / "card.json", *answers())
    assert code == 2
    assert "which is there already" in err
    assert (tmp_path / "card.json").read_text() == "signed by hand"


def test_an_answer_without_a_value(run, tmp_path):
    code, _, err = run("fill", "--out", tmp_path / "card.json", "--set", "spotter")
    assert code == 2
    assert "--set is 'spotter', expected name=value" in err


def test_sign_and_verify_are_the_commands_of_that_name(run):
    code, out, _ = run("verify", "--today", TODAY)
    assert code == 3
    assert "PENDING_REVIEW" in out
