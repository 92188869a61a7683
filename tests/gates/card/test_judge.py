"""Gate E: the chain below, forgeries, days."""

import base64
import datetime
import json

import evidence
import pytest
from team import PEOPLE


@pytest.fixture
def signed(team):
    team.sign(team.complete(), PEOPLE)
    return team


def _red(report):
    return {c.id for c in report.criteria if c.verdict != "PASS"}


def test_a_complete_signed_card_passes_with_the_chain_below_it(signed):
    report = signed.judge()
    assert report.verdict == "PASS", [(c.id, c.caveat) for c in report.criteria]


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


def _other_draft(root):
    _byte(root, "artifacts/card/card.json")
    evidence.record(root)


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
        lambda t: t.forge(_edit(abort_thresholds={"latency_s": 9.0})),
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
    "the draft changed": (lambda t: _other_draft(t.root), "signature_valid"),
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
