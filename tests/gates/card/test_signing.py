"""Trial card and Gate E: pending until people sign; forged cards are refused (P21)."""

import base64
import json
from types import SimpleNamespace

import pytest
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey
from team import AUTHORS, KEYS, PEOPLE

from gates.card import signing
from gates.card.signing import load_allow_list, sign_card
from genpolicy.errors import BadInputError
from genpolicy.integrity.documents import canonical_json


@pytest.mark.parametrize("same_file", [True, False])
@pytest.mark.parametrize("order", [tuple(PEOPLE), tuple(reversed(PEOPLE))])
def test_five_people_sign_one_card_and_five_signatures_remain(team, order, same_file):
    """Each the completed card, as the page says, or each the envelope of those before."""
    completed = path = team.complete()
    for count, name in enumerate(order):
        assert team.judge().verdict == "PENDING_REVIEW"
        path = team.sign(completed if same_file else path, [name])
        assert len(json.loads(team.envelope.read_bytes())["signatures"]) == count + 1
    assert team.judge().verdict == "PASS"


def test_signatures_of_two_copies_are_put_together(team):
    """Two who were handed the same card sign at the same time, each at home."""
    team.sign(team.complete(), ["rita", "mo"])
    copy = team.root.parent / "copy.dsse.json"
    team.envelope.rename(copy)
    team.sign(team.complete(), ["sam", "mo"])
    team.sign(copy, ["col"])
    team.sign(team.complete(), ["pia"])
    assert len(json.loads(team.envelope.read_bytes())["signatures"]) == len(PEOPLE)
    assert team.judge().verdict == "PASS"


def test_another_card_of_the_name_loses_nothing_and_says_what_to_do(team):
    team.sign(team.complete(), ["rita"])
    before = team.envelope.read_bytes()
    with pytest.raises(BadInputError, match="another card of this name") as refused:
        team.sign(team.complete(nonce="another-nonce-of-16"), ["mo"])
    assert "cards/trial.dsse.json" in refused.value.action
    assert team.envelope.read_bytes() == before


@pytest.mark.parametrize("spoil", ["a key that is withdrawn", "a signature that does not verify"])
def test_signatures_that_lie_there_are_verified_before_one_is_added(team, spoil):
    team.sign(team.complete(), ["rita"])
    if spoil.startswith("a key"):
        team.allow({**{n: r for n, r in PEOPLE.items() if n != "rita"}, **AUTHORS})
    else:
        document = json.loads(team.envelope.read_bytes())
        document["signatures"][0]["sig"] = base64.b64encode(b"x" * 64).decode()
        team.envelope.write_bytes(canonical_json(document))
    before = team.envelope.read_bytes()
    with pytest.raises(BadInputError, match=r"unknown key|does not verify"):
        team.sign(team.complete(reviewer="rita"), ["mo"])
    assert team.envelope.read_bytes() == before


@pytest.mark.parametrize(
    ("changes", "name", "text", "action"),
    [
        ({"force_limit_n": None}, "rita", "incomplete", "card fill"),
        ({"candidate": "another"}, "rita", "candidate", "draft fixes, nobody fills in"),
        ({"reviewer": "Someone Else"}, "rita", "Someone Else", "Have Someone Else sign, or fill"),
        ({"spotter": "Sam"}, "rita", r"incomplete \(spotter\)", "card fill"),
        ({"spotter": "rita"}, "rita", "rita is reviewer and spotter", "Name an owner"),
        ({"spotter": "ada"}, "mo", "ada is author and spotter", "Name an owner"),
        ({"spotter": "nobody"}, "mo", "'nobody' is not on", "not on it yet is entered in review"),
        ({"caveats": []}, "rita", "caveats is without", "Put each back, word for word"),
        ({"caveats": ["All is well."]}, "rita", "caveats is without", "Put each back"),
        ({}, "eve", "listed person", "genpolicy card keygen"),
        ({}, "ada", "ada is an author and signs", "who did not make the candidate"),
    ],
)
def test_signing_refuses_what_cannot_pass_and_says_what_to_do(team, changes, name, text, action):
    with pytest.raises(BadInputError, match=text) as refused:
        team.sign(team.complete(**changes), [name])
    assert action in refused.value.action
    assert not team.envelope.exists()


def test_signing_with_another_persons_key_is_refused(team):
    with pytest.raises(BadInputError, match="another key") as refused:
        sign_card(
            team.root,
            card_file=team.complete(),
            key_file=team.folder / "eve",
            reviewer="rita",
        )
    assert "Sign with the private key of that entry" in refused.value.action


@pytest.mark.parametrize("same_file", [True, False])
def test_nobody_signs_twice(team, same_file):
    path = team.sign(team.complete(), ["mo", "rita"])
    before = path.read_bytes()
    with pytest.raises(BadInputError, match="signed by rita already") as refused:
        team.sign(team.complete() if same_file else path, ["rita"])
    assert "the others sign" in refused.value.action
    assert path.read_bytes() == before


@pytest.mark.parametrize(("spoil", "found", "action"), [
    (lambda team: (team.root / "reports/gate_b.json").write_text("{}"), "names other bytes",
     "has changed: move it to a subfolder of cards/"),
    (lambda team: team.forge(lambda card: card, ["rita", "eve"]), "unknown key",
     "committed to reviewers.yaml if it belongs there"),
    (lambda team: team.write(b"{}", ["rita"]), "predicate", ""),
    (lambda team: team.write(_payload(team), ["eve"], keyid_of={"eve": "rita"}), "does not verify",
     "One bad signature voids all"),
])  # fmt: skip
def test_an_envelope_that_is_not_good_is_refused_with_what_to_do(team, spoil, found, action):
    path = team.sign(team.complete(), ["rita"])
    spoil(team)
    with pytest.raises(BadInputError, match=found) as refused:
        team.sign(path, ["mo"])
    assert action in refused.value.action


def _payload(team):
    return base64.b64decode(json.loads(team.envelope.read_bytes())["payload"])


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
    waits = team.judge()
    assert waits.verdict == "PENDING_REVIEW"
    assert waits.decision == "Wait for nobody: no card of a rehearsal can be signed."
    with pytest.raises(BadInputError, match="rehearsal") as refused:
        team.sign(team.complete(), ["rita"])
    assert "without `rehearsal: true`" in refused.value.action


def test_without_a_plan_nothing_is_signed_and_nothing_is_valid(team):
    path = team.sign(team.complete(), PEOPLE)
    assert team.judge().verdict == "PASS"
    (team.root / "preregistration.yaml").unlink()
    report = team.judge()
    assert report.verdict == "FAIL"
    red = {c.id: c.caveat for c in report.criteria if c.verdict != "PASS"}
    assert "planned in writing" in red["signature_valid"]
    path.unlink()
    with pytest.raises(BadInputError, match="preregistration") as refused:
        team.sign(team.complete(), ["rita"])
    assert "genpolicy gates preregister" in refused.value.action


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
    with pytest.raises(BadInputError, match="the private key") as refused:
        sign_card(team.root, card_file=team.complete(), key_file=file, reviewer="rita")
    assert refused.value.action == signing.PEM_FILE
    assert not team.envelope.exists()


def test_a_key_that_the_library_does_not_know_is_bad_input(team, monkeypatch):
    """As where it was built without a curve: the file names what this machine cannot read."""

    def unsupported(data, password):
        raise UnsupportedAlgorithm("a curve of its own")

    monkeypatch.setattr(signing, "load_pem_private_key", unsupported)
    with pytest.raises(BadInputError, match="the private key is not readable"):
        team.sign(team.complete(), ["rita"])


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
