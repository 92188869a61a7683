"""Trial card and Gate E: pending until people sign; forged cards are refused (P21)."""

import base64
import datetime
import json

import evidence
import pytest
import yaml
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from securesystemslib.signer import SSlibKey

from gates import proof
from gates.card.card import Envelope, TrialCard, envelope_violations, missing_fields
from gates.card.signing import PAYLOAD_TYPE, load_allow_list, read_draft, sign_card
from genpolicy.errors import BadInputError, ConfigError
from genpolicy.integrity.documents import canonical_json

TODAY = datetime.date(2026, 11, 21)
PEOPLE = {
    "Rita Reviewer": "reviewer",
    "Mo Model": "model",
    "Pia Perception": "perception",
    "Col Controller": "controller",
    "Sam Safety": "safety",
}
FILLED = {
    "force_limit_n": 30.0,
    "force_limit_reason": "measured at this cell",
    "spotter": "Sam Safety",
    "stop_path": "hand button to drive enable",
    "reviewer": "Rita Reviewer",
    "not_before": "2026-11-20",
    "expires": "2026-11-30",
    "nonce": "0123456789abcdef0",
}


class Team:
    """People with keys, and the card they sign."""

    def __init__(self, root):
        self.root = root
        self.keys = {name: Ed25519PrivateKey.generate() for name in [*PEOPLE, "Ada Author", "Eve"]}
        self.folder = root.parent / "keys"
        self.folder.mkdir(exist_ok=True)
        for name, key in self.keys.items():
            pem = key.private_bytes(
                serialization.Encoding.PEM,
                serialization.PrivateFormat.PKCS8,
                serialization.NoEncryption(),
            )
            (self.folder / name).write_bytes(pem)
        self.allow(PEOPLE)

    def allow(self, people):
        entries = [
            {"name": n, "role": r, "public_key": self.keys[n].public_key().public_bytes_raw().hex()}
            for n, r in people.items()
        ]
        (self.root / "reviewers.yaml").write_text(yaml.safe_dump({"people": entries}))

    def complete(self, **changes):
        draft = json.loads((self.root / "artifacts/card/card.json").read_bytes())
        path = self.root / "completed.json"
        path.write_bytes(canonical_json({**draft, **FILLED, **changes}))
        return path

    def sign(self, path, names):
        for name in names:
            path = sign_card(self.root, card_file=path, key_file=self.folder / name, reviewer=name)
        return path

    @property
    def envelope(self):
        return self.root / "cards/trial.dsse.json"

    def forge(self, change, names=tuple(PEOPLE)):
        """Sign any payload with real keys, past every check of `sign_card`."""
        document = json.loads(self.envelope.read_bytes())
        payload = change(json.loads(base64.b64decode(document["payload"])))
        data = payload if isinstance(payload, bytes) else canonical_json(payload)
        self.write(data, names)

    def write(self, data, names, payload_type=PAYLOAD_TYPE, keyid_of=None):
        pae = b"DSSEv1 %d %b %d %b" % (
            len(payload_type),
            payload_type.encode(),
            len(data),
            data,
        )
        signatures = []
        for name in names:
            public = self.keys[(keyid_of or {}).get(name, name)].public_key()
            signatures.append(
                {
                    "keyid": SSlibKey.from_crypto(public).keyid,
                    "sig": base64.b64encode(self.keys[name].sign(pae)).decode(),
                }
            )
        self.envelope.write_bytes(
            canonical_json(
                {
                    "payload": base64.b64encode(data).decode(),
                    "payloadType": payload_type,
                    "signatures": signatures,
                }
            )
        )

    def judge(self, today=TODAY):
        return proof.judge(self.root, "E", today=today)


@pytest.fixture(scope="session")
def _chain(_ladder):
    return proof.prove_chain(_ladder, "D")


@pytest.fixture
def quick_chain(_chain, monkeypatch):
    """The chain as proved once: for tests that change nothing below the card."""
    monkeypatch.setattr(proof, "prove_chain", lambda root, through: _chain)


@pytest.fixture
def team(ladder, request):
    if "below" not in getattr(request.node, "name", ""):
        request.getfixturevalue("quick_chain")
    return Team(ladder)


@pytest.fixture
def signed(team):
    team.sign(team.complete(), PEOPLE)
    return team


def _red(report):
    return {c.id for c in report.criteria if c.verdict != "PASS"}


def test_the_draft_implies_no_force_limit_and_is_pending(team):
    draft = read_draft(team.root)
    assert draft.force_limit_n is None
    assert {"force_limit_n", "spotter", "stop_path", "reviewer"} <= set(missing_fields(draft))
    report = team.judge()
    assert report.verdict == "PENDING_REVIEW"
    assert {c.verdict for c in report.criteria if c.id == "upstream_passed"} == {"PASS"}


def test_a_complete_signed_card_passes_with_the_chain_below_it(signed):
    report = signed.judge()
    assert report.verdict == "PASS", [(c.id, c.caveat) for c in report.criteria]


def test_signing_in_turns_waits_for_the_last_owner(team):
    path = team.complete()
    for name in PEOPLE:
        assert team.judge().verdict != "PASS"
        path = team.sign(path, [name])
    assert team.judge().verdict == "PASS"


def _edit(**changes):
    def change(statement):
        statement["predicate"].update(changes)
        return statement

    return change


def _subject(statement):
    statement["subject"][0]["digest"]["sha256"] = "0" * 64
    return statement


def _byte(root, path):
    file = root / path
    file.write_bytes(file.read_bytes() + b" ")


def _other_type(t):
    data = base64.b64decode(json.loads(t.envelope.read_bytes())["payload"])
    t.write(data, PEOPLE, payload_type="application/vnd.in-toto+json")


def _document(change):
    def apply(team):
        document = json.loads(team.envelope.read_bytes())
        change(document)
        team.envelope.write_text(json.dumps(document))

    return apply


def _tamper(document):
    payload = base64.b64decode(document["payload"]).replace(
        b'"force_limit_n": 30', b'"force_limit_n": 99'
    )
    document["payload"] = base64.b64encode(payload).decode()


def _truncate(document):
    document["payload"] = document["payload"][:-5]


def _twice(document):
    document["signatures"].append(document["signatures"][0])


def _duplicate_key(team):
    text = team.envelope.read_text()
    team.envelope.write_text(text.replace("{", '{"payloadType": "x",', 1))


def _second_card(team):
    (team.root / "cards/other.dsse.json").write_bytes(team.envelope.read_bytes())


def _impostor(team):
    data = base64.b64decode(json.loads(team.envelope.read_bytes())["payload"])
    names = ["Eve", *list(PEOPLE)[1:]]
    team.write(data, names, keyid_of={"Eve": "Rita Reviewer"})


def _self_review(team):
    team.allow({**{n: r for n, r in PEOPLE.items() if r != "reviewer"}, "Ada Author": "reviewer"})
    names = [*list(PEOPLE)[1:], "Ada Author"]
    team.forge(_edit(reviewer="Ada Author"), names)


FORGERIES = {
    "payload tampered": (_document(_tamper), "signature_valid"),
    "another payload type": (_other_type, "signature_valid"),
    "payload truncated": (_document(_truncate), "signature_valid"),
    "signature repeated": (_document(_twice), "signature_valid"),
    "signatures removed": (_document(lambda d: d.update(signatures=[])), "signature_valid"),
    "duplicate JSON key": (_duplicate_key, "signature_valid"),
    "empty file": (lambda t: t.envelope.write_bytes(b""), "signature_valid"),
    "key not on the list": (
        lambda t: t.allow({n: r for n, r in PEOPLE.items() if n != "Rita Reviewer"}),
        "signature_valid",
    ),
    "another key under a listed name": (_impostor, "signature_valid"),
    "author reviews": (_self_review, "reviewer_independent"),
    "named reviewer did not sign": (
        lambda t: t.forge(lambda s: s, list(PEOPLE)[1:]),
        "reviewer_independent",
    ),
    "an owner is missing": (lambda t: t.forge(lambda s: s, list(PEOPLE)[:-1]), "owners_signed"),
    "card of another candidate": (lambda t: t.forge(_edit(candidate="flow")), "signature_valid"),
    "card of another checkpoint": (
        lambda t: t.forge(_edit(candidate_checkpoint_sha256="0" * 64)),
        "signature_valid",
    ),
    "card of another robot": (lambda t: t.forge(_edit(robot_model="fr3")), "signature_valid"),
    "another author on the card": (lambda t: t.forge(_edit(author="Someone")), "signature_valid"),
    "subject of another chain": (lambda t: t.forge(_subject), "signature_valid"),
    "force limit empty": (lambda t: t.forge(_edit(force_limit_n=None)), "draft_complete"),
    "force limit zero": (lambda t: t.forge(_edit(force_limit_n=0.0)), "envelope_within_limits"),
    "spotter blank": (lambda t: t.forge(_edit(spotter="  ")), "draft_complete"),
    "faster than simulated": (
        lambda t: t.forge(_edit(speed_limit_m_s=0.5)),
        "envelope_within_limits",
    ),
    "workspace beyond the simulated one": (
        lambda t: t.forge(_edit(workspace_upper_m=[0.9, 0.2, 0.25])),
        "envelope_within_limits",
    ),
    "abort threshold raised": (
        lambda t: t.forge(_edit(abort_thresholds={"action_age_s": 9.0})),
        "envelope_within_limits",
    ),
    "valid for years": (lambda t: t.forge(_edit(expires="2036-01-01")), "not_expired"),
    "expiry that is no day": (lambda t: t.forge(_edit(expires="soon")), "not_expired"),
    "short nonce": (lambda t: t.forge(_edit(nonce="1")), "draft_complete"),
    "unknown field": (lambda t: t.forge(_edit(approved=True)), "signature_valid"),
    "two cards": (_second_card, "signature_valid"),
    "a report below changed": (lambda t: _byte(t.root, "reports/gate_b.json"), "upstream_passed"),
    "evidence below changed": (
        lambda t: _byte(t.root, "artifacts/audit/summary.json"),
        "upstream_passed",
    ),
    "the draft changed": (lambda t: _byte(t.root, "artifacts/card/card.json"), "signature_valid"),
}


@pytest.mark.parametrize("kind", FORGERIES)
def test_forged_cards_are_refused(signed, kind):
    forge, criterion = FORGERIES[kind]
    forge(signed)
    report = signed.judge()
    assert report.verdict not in ("PASS", "PENDING_REVIEW"), kind
    assert criterion in _red(report), (kind, _red(report))


@pytest.mark.parametrize("day", [datetime.date(2026, 11, 19), datetime.date(2026, 12, 1)])
def test_outside_its_days_the_card_is_void(signed, day):
    report = signed.judge(today=day)
    assert report.verdict == "FAIL"
    assert _red(report) == {"not_expired"}


@pytest.mark.parametrize(
    ("changes", "name", "text"),
    [
        ({"force_limit_n": None}, "Rita Reviewer", "incomplete"),
        ({"candidate": "flow"}, "Rita Reviewer", "candidate"),
        ({"reviewer": "Someone Else"}, "Rita Reviewer", "Someone Else"),
        ({}, "Eve", "listed person"),
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
            key_file=team.folder / "Eve",
            reviewer="Rita Reviewer",
        )


def test_one_person_cannot_hold_two_roles(team):
    entry = yaml.safe_load((team.root / "reviewers.yaml").read_text())["people"]
    for twin in ({**entry[0], "name": "Other"}, {**entry[0], "public_key": "ab" * 32}):
        (team.root / "reviewers.yaml").write_text(yaml.safe_dump({"people": [*entry, twin]}))
        with pytest.raises(ConfigError, match="twice"):
            load_allow_list(team.root)


def test_the_shipped_allow_list_names_nobody(request):
    assert load_allow_list(request.config.rootpath).people == ()


def test_limits_are_checked_on_every_side(team):
    draft = read_draft(team.root)
    section = evidence.PARAMS["gate_e"]
    envelope = Envelope(
        workspace_lower_m=tuple(section["workspace_lower_m"]),
        workspace_upper_m=tuple(section["workspace_upper_m"]),
        speed_limit_m_s=section["speed_limit_m_s"],
        maximum_days=30,
    )
    good = TrialCard.model_validate(
        {**draft.model_dump(), **{k: v for k, v in FILLED.items() if k != "reviewer"}}
    )
    assert envelope_violations(good, draft, envelope) == []
    for change in (
        {"workspace_lower_m": (0.2, -0.2, 0.03)},
        {"workspace_lower_m": (0.71, -0.2, 0.03)},
        {"workspace_lower_m": None},
        {"speed_limit_m_s": None},
        {"speed_limit_m_s": 0.0},
        {"abort_thresholds": {}},
        {"abort_thresholds": {**draft.abort_thresholds, "action_age_s": -1.0}},
    ):
        assert envelope_violations(good.model_copy(update=change), draft, envelope), change
