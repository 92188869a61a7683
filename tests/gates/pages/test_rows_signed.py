"""Rows of Gate E: who signed, by which key and over which bytes, and for whom the card waits."""

import csv
import io
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "card"))

from team import KEYS, PEOPLE, Team

from gates import proof
from gates.card.papers import examine
from gates.card.signing import statement
from gates.pages.rows import rows_of
from gates.pages.rows_signed import KEY_DIGITS, NAME, signature_rows
from genpolicy.integrity.hashing import sha256_bytes


@pytest.fixture(scope="module")
def _chain(_ladder):
    return proof.prove_chain(_ladder, "D")


@pytest.fixture
def team(ladder, _chain, monkeypatch):
    """People with keys, over a chain that is proved once: nothing below the card is changed."""
    monkeypatch.setattr(proof, "prove_chain", lambda root, through: _chain)
    return Team(ladder)


def read(team):
    data = signature_rows(team.root, team.judge()).data
    return {row["role"]: row for row in csv.DictReader(io.StringIO(data.decode()))}


def test_a_card_that_nobody_signed_waits_for_each_by_name(team):
    found = read(team)
    assert set(found) == set(PEOPLE.values()) and {r["verdict"] for r in found.values()} == {
        "waits"
    }
    assert {row["role"]: row["why"] for row in found.values()} == {
        role: f"for {name}" for name, role in PEOPLE.items()
    }
    assert {row["key"] for row in found.values()} == {""}


def test_each_signature_stands_with_its_key_and_the_bytes_that_it_is_over(team):
    """The key's name and the hash are made here from the key and the statement."""
    from securesystemslib.signer import SSlibKey

    team.sign(team.complete(), ["rita", "mo"])
    found = read(team)
    card = examine(team.root, "trial").signed.card
    digest = sha256_bytes(statement(team.root, card))[:12]
    for name, role in PEOPLE.items():
        row = found[role]
        if name not in ("rita", "mo"):
            assert (row["verdict"], row["person"], row["why"]) == ("waits", "", f"for {name}")
            continue
        key = SSlibKey.from_crypto(KEYS[name].public_key()).keyid
        assert (row["person"], row["key"]) == (name, key[:KEY_DIGITS])
        assert (row["verdict"], row["card_sha256"]) == ("signed", digest)
        assert (row["from"], row["until"]) == (card.not_before, card.expires)


def test_a_card_that_is_refused_says_why_and_nobody_has_signed(team):
    team.sign(team.complete(), PEOPLE)
    team.forge(lambda document: {**document, "subject": []})
    found = read(team)
    assert {row["verdict"] for row in found.values()} == {"refused"}
    assert all("names other bytes than lie here" in row["why"] for row in found.values())


def test_the_criteria_of_signatures_lead_to_them(team):
    team.sign(team.complete(), PEOPLE)
    report = team.judge()
    rows = rows_of(team.root, report)
    for name in ("signature_valid", "reviewer_independent", "owners_signed", "not_expired"):
        (answer,) = [c for c in report.criteria if c.id == name]
        assert [file.name for file in rows.under(answer)] == [NAME], name
        assert rows.under(answer)[0].title == "signatures"


@pytest.mark.parametrize("path", ["cards/trial.dsse.json", "reviewers.yaml"])
def test_of_other_bytes_than_were_judged_nothing_is_shown(team, path):
    team.sign(team.complete(), PEOPLE)
    report = team.judge()
    (team.root / path).write_bytes((team.root / path).read_bytes() + b"\n")
    assert signature_rows(team.root, report) is None
    assert NAME not in [file.name for file in rows_of(team.root, report).files]
