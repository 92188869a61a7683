"""Trial card and Gate E: pending until people sign; forged cards are refused (P21)."""

import json
import re
from types import SimpleNamespace

import pytest
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey
from team import KEYS, PEOPLE

from gates.card import signing
from gates.card.signing import load_allow_list, sign_card
from genpolicy.errors import BadInputError
from genpolicy.integrity.documents import canonical_json


def test_signing_in_turns_waits_for_the_last_owner(team):
    path = team.complete()
    for name in PEOPLE:
        assert team.judge().verdict != "PASS"
        path = team.sign(path, [name])
    assert team.judge().verdict == "PASS"


@pytest.mark.parametrize(
    ("changes", "name", "text"),
    [
        ({"force_limit_n": None}, "rita", "incomplete"),
        ({"candidate": "another"}, "rita", "candidate"),
        ({"reviewer": "Someone Else"}, "rita", "Someone Else"),
        ({"spotter": "Sam"}, "rita", r"incomplete \(spotter\)"),
        ({"spotter": "rita"}, "rita", "rita is reviewer and spotter"),
        ({"spotter": "ada"}, "mo", "ada is author and spotter"),
        ({"spotter": "nobody"}, "mo", "'nobody' is not on"),
        ({"caveats": []}, "rita", "caveats is without"),
        ({"caveats": ["All is well."]}, "rita", "caveats is without"),
        ({}, "eve", "listed person"),
    ],
)
def test_signing_refuses_what_cannot_pass(team, changes, name, text):
    with pytest.raises(BadInputError, match=text):
        team.sign(team.complete(**changes), [name])
    assert not team.envelope.exists()


def test_signing_with_another_persons_key_is_refused(team):
    with pytest.raises(BadInputError, match="another key"):
        sign_card(
            team.root,
            card_file=team.complete(),
            key_file=team.folder / "eve",
            reviewer="rita",
        )


def test_nobody_signs_twice(team):
    path = team.sign(team.complete(), ["rita"])
    with pytest.raises(BadInputError, match="signed by rita already"):
        team.sign(path, ["rita"])


@pytest.mark.parametrize("authors", [["ada", "rita"], ["rita"], [], ["nobody"]])
def test_a_reviewer_who_made_the_candidate_cannot_sign(team, authors):
    _redraft(team, authors)
    with pytest.raises(BadInputError, match="author"):
        team.sign(team.complete(authors=authors), ["rita"])


def test_neither_an_owner_who_made_the_candidate_nor_an_author_can_sign(team):
    with pytest.raises(BadInputError, match="ada is an author and signs"):
        team.sign(team.complete(), ["ada"])
    _redraft(team, ["mo"])
    with pytest.raises(BadInputError, match="mo is an author and signs"):
        team.sign(team.complete(authors=["mo"]), ["rita", "mo"])


def _redraft(team, authors):
    path = team.root / "artifacts/card/card.json"
    path.write_bytes(canonical_json({**json.loads(path.read_bytes()), "authors": authors}))


def test_a_rehearsal_is_never_signed_and_never_valid(team):
    path = team.sign(team.complete(), PEOPLE)
    assert team.judge().verdict == "PASS"
    params = team.root / "params.yaml"
    params.write_text("rehearsal: true\n" + params.read_text())
    report = team.judge()
    assert report.verdict == "FAIL"
    red = {c.id: c.caveat for c in report.criteria if c.verdict != "PASS"}
    assert "rehearsal" in red["signature_valid"]
    assert any("rehearsal" in caveat for caveat in report.caveats)
    path.unlink()
    assert team.judge().verdict == "PENDING_REVIEW"
    with pytest.raises(BadInputError, match="rehearsal"):
        team.sign(team.complete(), ["rita"])


def test_without_a_plan_nothing_is_signed_and_nothing_is_valid(team):
    path = team.sign(team.complete(), PEOPLE)
    assert team.judge().verdict == "PASS"
    (team.root / "preregistration.yaml").unlink()
    report = team.judge()
    assert report.verdict == "FAIL"
    red = {c.id: c.caveat for c in report.criteria if c.verdict != "PASS"}
    assert "planned in writing" in red["signature_valid"]
    path.unlink()
    with pytest.raises(BadInputError, match="preregistration"):
        team.sign(team.complete(), ["rita"])


def test_the_shipped_allow_list_names_nobody(request):
    assert load_allow_list(request.config.rootpath).people == ()


def _pem(key, protection):
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, protection
    )


@pytest.mark.parametrize("kind", ["missing", "text", "with a password", "of another kind"])
def test_a_private_key_that_cannot_sign_is_bad_input(team, kind):
    data = {
        "text": b"no key",
        "with a password": _pem(KEYS["rita"], serialization.BestAvailableEncryption(b"x")),
        "of another kind": _pem(X25519PrivateKey.generate(), serialization.NoEncryption()),
    }
    file = team.folder / "odd"
    file.unlink(missing_ok=True)
    if kind in data:
        file.write_bytes(data[kind])
    with pytest.raises(BadInputError, match="the private key"):
        sign_card(team.root, card_file=team.complete(), key_file=file, reviewer="rita")
    assert not team.envelope.exists()


def test_a_key_that_the_library_does_not_know_is_bad_input(team, monkeypatch):
    """As where it was built without a curve: the file names what this machine cannot read."""

    def unsupported(data, password):
        raise UnsupportedAlgorithm("a curve of its own")

    monkeypatch.setattr(signing, "load_pem_private_key", unsupported)
    with pytest.raises(BadInputError, match="the private key is not readable"):
        team.sign(team.complete(), ["rita"])


SIGNED = {"payload": "", "payloadType": signing.PAYLOAD_TYPE, "signatures": [
    {"keyid": "k", "sig": ""},
]}  # fmt: skip


@pytest.mark.parametrize(("changes", "found"), [
    ({"payloadType": "p" * 80}, "payloadType is '" + "p" * 59 + ", "),
    ({"payloadType": "p" * 57}, "payloadType is '" + "p" * 57 + "', "),
    ({"signatures": [{"keyid": [1] * 80, "sig": ""}]}, "keyid is [" + "1, " * 19 + "1,, "),
    ({"signatures": []}, "signatures is empty, "), ({"signatures": "k"}, "signatures is empty, "),
    ({"signatures": [SIGNED["signatures"][0], 3]}, "signatures is another form, "),
    ({"signatures": [{"keyid": "k"}]}, "signatures is another form, "),
    ({"signatures": [{"keyid": "k", "sig": "?"}]}, "sig is not base64, "),
    ({"signatures": [{"keyid": "k", "sig": 3}]}, "sig is not base64, "),
    ({"payload": "?"}, "payload is not base64, "), ({"more": 1}, "c is another document, "),
])  # fmt: skip
def test_an_envelope_of_another_form_is_refused_by_its_part(changes, found):
    whole = canonical_json({**SIGNED, **changes})
    assert signing._parse_envelope(canonical_json(SIGNED), "c") == (b"", SIGNED["signatures"])
    with pytest.raises(BadInputError, match=re.escape(found)):
        signing._parse_envelope(whole, "c")


@pytest.mark.parametrize("length", [59, 60, 61])
def test_a_caveat_that_is_left_out_is_quoted_and_the_rest_may_be_more(
    monkeypatch, tmp_path, length
):
    """Sixty signs of the first that lacks; what else stands on the card is somebody's care."""
    required = ["kept", "x" * length, "y"]
    fields = dict.fromkeys(signing.FIXED, "same")
    draft = SimpleNamespace(**fields, caveats=required)
    monkeypatch.setattr(signing, "read_draft", lambda root: draft)
    signing._check_fixed(tmp_path, SimpleNamespace(**fields, caveats=[*required, "more"]), "c")
    with pytest.raises(BadInputError, match=rf"c: caveats is without 'x{{{min(length, 60)}}}', "):
        signing._check_fixed(tmp_path, SimpleNamespace(**fields, caveats=["more", "kept"]), "c")
    for name in signing.FIXED:
        card = SimpleNamespace(**{**fields, name: "other"}, caveats=required)
        with pytest.raises(BadInputError, match=rf"c: {name} is another value"):
            signing._check_fixed(tmp_path, card, "c")
