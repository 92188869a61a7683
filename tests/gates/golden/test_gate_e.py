"""The whole report of Gate E: a card that waits, one that all have signed, one that is refused."""

import sys
from pathlib import Path

import pytest
from as_told import hold, told

sys.path.insert(0, str(Path(__file__).parents[1] / "card"))

from team import PEOPLE, Team

from gates import proof


@pytest.fixture(scope="module")
def _chain(_ladder):
    return proof.prove_chain(_ladder, "D")


@pytest.fixture
def team(ladder, _chain, monkeypatch):
    """People with keys, over a chain that is proved once: nothing below the card is changed."""
    monkeypatch.setattr(proof, "prove_chain", lambda root, through: _chain)
    return Team(ladder)


def test_gate_e_of_a_draft_says_what_it_said(team):
    hold("gate_e_waits", told(team.judge()))


def test_gate_e_of_a_signed_card_says_what_it_said(team):
    team.sign(team.complete(), PEOPLE)
    hold("gate_e_signed", told(team.judge()))


def test_gate_e_of_a_card_that_lacks_much_says_what_it_said(team):
    """Two owners, no spotter, too hard a touch, a threshold raised, valid for too long."""
    team.sign(team.complete(), ["rita", "mo"])

    def worse(statement):
        card = statement["predicate"]
        card["spotter"], card["force_limit_n"] = "", 80.5
        card["abort_thresholds"]["latency_s"] += 0.1
        card["expires"] = "2027-03-01"
        return statement

    team.forge(worse, ["rita", "mo"])
    hold("gate_e_refused", told(team.judge()))
