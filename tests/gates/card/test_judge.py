"""Gate E: the chain below, forgeries, days."""

import base64
import datetime
import json

import evidence
import pytest
import yaml
from team import AUTHORS, PEOPLE

from gates import proof
from gates.card.card import card_bytes
from gates.card.drafting import draft
from gates.card.judge import CardGateSettings
from gates.card.papers import examine
from gates.claim import CHECKPOINT_ONLY
from gates.report import parse_section, read_report, report_bytes, report_path
from genpolicy.errors import ConfigError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_file


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


def _with_threshold(statement, name):
    statement["predicate"]["abort_thresholds"][name] = 0.0
    return statement


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
    names = ["eve", *list(PEOPLE)[1:]]
    team.write(data, names, keyid_of={"eve": "rita"})


def _allowing(**roles):
    """The team's list with other roles, or without people (None)."""
    people = {**PEOPLE, **AUTHORS, **roles}
    return {name: role for name, role in people.items() if role}


def _author_reviews(team):
    team.allow(_allowing(ada="reviewer", rita=None))
    team.forge(_edit(reviewer="ada"), ["ada", *list(PEOPLE)[1:]])


def _author_owns(team):
    """The model owner is named as an author in the settings, the draft and the card."""
    _authors(team, ["ada", "mo"])


def _authors(team, names):
    """As if the settings, the draft and the card all named these authors."""
    _redraft(team, authors=names)


def _resubject(team, **changes):
    """A payload that signs the draft as it lies there now."""

    def change(statement):
        statement["predicate"].update(changes)
        for subject in statement["subject"]:
            if subject["name"].endswith("card.json"):
                subject["digest"]["sha256"] = sha256_file(team.root / subject["name"])
        return statement

    return change


def _redraft(team, **changes):
    """Another draft, and a card that was signed over it."""
    path = team.root / "artifacts/card/card.json"
    path.write_bytes(canonical_json({**json.loads(path.read_bytes()), **changes}))
    evidence.record(team.root)
    team.forge(_resubject(team, **changes))


def _looser(**changes):
    """A card and its draft that allow more than was simulated."""
    return lambda team: _redraft(team, **changes)


def _other_draft(root):
    _byte(root, "artifacts/card/card.json")
    evidence.record(root)


def _without_caveats(team, kept):
    """A draft that leaves caveats of the reports out, and a card that was signed over it."""
    _redraft(team, caveats=kept)


def _url_safe(part):
    """The same bytes as base64url."""

    def change(team):
        team.forge(_edit(stop_path="at the door ??????"))  # as base64 it has a slash
        before = team.envelope.read_text()
        document = json.loads(before)
        for holder in [document] if part == "payload" else document["signatures"]:
            holder[part] = holder[part].replace("+", "-").replace("/", "_").rstrip("=")
        assert document != json.loads(before)
        team.envelope.write_text(json.dumps(document))

    return change


def _in_alphabet(document):
    document["payload"] = f"!{document['payload']}"


def _another_reviewer(team):
    team.allow({**PEOPLE, **AUTHORS, "sue": "reviewer"})
    team.forge(lambda s: s, ["sue", *list(PEOPLE)[1:]])


def _out_of_turn(team):
    team.allow({**PEOPLE, **AUTHORS, "sue": "spotter"})
    team.forge(lambda s: s, [*list(PEOPLE)[:-1], "sue"])


FORGERIES = {
    "a character that is no base64": (_document(_in_alphabet), "signature_valid"),
    "the payload as base64url": (_url_safe("payload"), "signature_valid"),
    "signatures as base64url": (_url_safe("sig"), "signature_valid"),
    "a field beside the payload": (_document(lambda d: d.update(note="ok")), "signature_valid"),
    "a field beside a signature": (
        _document(lambda d: d["signatures"][0].update(note="ok")),
        "signature_valid",
    ),
    "signatures by name": (
        _document(lambda d: d.update(signatures={"rita": 1})),
        "signature_valid",
    ),
    "a payload that is no text": (_document(lambda d: d.update(payload=1)), "signature_valid"),
    "payload tampered": (_document(_tamper), "signature_valid"),
    "another payload type": (_other_type, "signature_valid"),
    "payload truncated": (_document(_truncate), "signature_valid"),
    "signature repeated": (_document(_twice), "signature_valid"),
    "signatures removed": (_document(lambda d: d.update(signatures=[])), "signature_valid"),
    "duplicate JSON key": (_duplicate_key, "signature_valid"),
    "empty file": (lambda t: t.envelope.write_bytes(b""), "signature_valid"),
    "key not on the list": (lambda t: t.allow(_allowing(rita=None)), "signature_valid"),
    "another key under a listed name": (_impostor, "signature_valid"),
    "author reviews": (_author_reviews, "reviewer_independent"),
    "an author is an owner": (_author_owns, "reviewer_independent"),
    "an author whom nobody knows": (lambda t: _authors(t, ["nobody"]), "reviewer_independent"),
    "no author": (lambda t: _authors(t, []), "reviewer_independent"),
    "an author signs as well": (
        lambda t: t.forge(lambda s: s, [*PEOPLE, "ada"]),
        "reviewer_independent",
    ),
    "reviewer named who has another role": (
        lambda t: t.forge(_edit(reviewer="sam")),
        "reviewer_independent",
    ),
    "another reviewer than the one who is named": (_another_reviewer, "reviewer_independent"),
    "an owner is missing, and somebody without a role signed": (
        _out_of_turn,
        "owners_signed",
    ),
    "card of another candidate": (lambda t: t.forge(_edit(candidate="another")), "signature_valid"),
    "card of another checkpoint": (
        lambda t: t.forge(_edit(candidate_checkpoint_sha256="0" * 64)),
        "signature_valid",
    ),
    "card of another robot": (lambda t: t.forge(_edit(robot_model="fr3")), "signature_valid"),
    "other authors on the card": (lambda t: t.forge(_edit(authors=["mo"])), "signature_valid"),
    "every caveat dropped": (lambda t: t.forge(_edit(caveats=[])), "signature_valid"),
    "every caveat dropped from the draft too": (
        lambda t: _without_caveats(t, []),
        "upstream_passed",
    ),
    "only what was tested kept in the draft": (
        lambda t: _without_caveats(t, [CHECKPOINT_ONLY]),
        "upstream_passed",
    ),
    "subject of another chain": (lambda t: t.forge(_subject), "signature_valid"),
    "force limit empty": (lambda t: t.forge(_edit(force_limit_n=None)), "draft_complete"),
    "force limit zero": (lambda t: t.forge(_edit(force_limit_n=0.0)), "envelope_within_limits"),
    "force limit of a thousand tonnes": (
        lambda t: t.forge(_edit(force_limit_n=1e9)),
        "envelope_within_limits",
    ),
    "force limit beyond all numbers": (
        lambda t: t.forge(_edit(force_limit_n=1e308)),
        "envelope_within_limits",
    ),
    "a workspace of nothing": (
        _looser(workspace_upper_m=[0.35 + 1e-12, -0.2 + 1e-12, 0.03 + 1e-12]),
        "envelope_within_limits",
    ),
    "a threshold that nobody knows": (
        lambda t: t.forge(lambda s: _with_threshold(s, "mood")),
        "envelope_within_limits",
    ),
    "the reviewer at the stop": (lambda t: t.forge(_edit(spotter="rita")), "reviewer_independent"),
    "the author at the stop": (lambda t: t.forge(_edit(spotter="ada")), "reviewer_independent"),
    "a stranger at the stop": (lambda t: t.forge(_edit(spotter="nobody")), "reviewer_independent"),
    "a spotter by name": (lambda t: t.forge(_edit(spotter="Sam S.")), "draft_complete"),
    "markup for a spotter": (lambda t: t.forge(_edit(spotter="<b>sam</b>")), "draft_complete"),
    "spotter blank": (lambda t: t.forge(_edit(spotter="  ")), "draft_complete"),
    "faster than the draft": (lambda t: t.forge(_edit(speed_limit_m_s=0.2501)), "signature_valid"),
    "slower than simulated": (_looser(speed_limit_m_s=0.2), "envelope_within_limits"),
    "faster than simulated": (_looser(speed_limit_m_s=0.2501), "envelope_within_limits"),
    "workspace beyond the simulated one": (
        _looser(workspace_upper_m=[0.71, 0.2, 0.25]),
        "envelope_within_limits",
    ),
    "workspace smaller than simulated": (
        _looser(workspace_lower_m=[0.4, -0.2, 0.03]),
        "envelope_within_limits",
    ),
    "robot that was not simulated": (_looser(robot_model="fr3"), "envelope_within_limits"),
    "no abort thresholds at all": (_looser(abort_thresholds={}), "envelope_within_limits"),
    "no abort thresholds, incomplete": (
        lambda t: t.forge(_edit(abort_thresholds={})),
        "draft_complete",
    ),
    "rollback empty": (_looser(rollback=""), "draft_complete"),
    "task empty": (_looser(task=" "), "draft_complete"),
    "another rollback": (lambda t: t.forge(_edit(rollback="go on")), "signature_valid"),
    "another task": (lambda t: t.forge(_edit(task="other")), "signature_valid"),
    "a draft of other reports": (
        _looser(reports=dict.fromkeys("ABCD", "0" * 64)),
        "upstream_passed",
    ),
    "a draft of another checkpoint": (
        _looser(candidate_checkpoint_sha256="0" * 64),
        "upstream_passed",
    ),
    "a draft of another candidate": (_looser(candidate="another"), "upstream_passed"),
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


@pytest.mark.parametrize(
    ("names", "waits", "measured"),
    [
        (["mo", "sam"], {"reviewer_independent", "owners_signed"}, 2.0),
        (["rita"], {"owners_signed"}, 0.0),
        (list(PEOPLE)[:-1], {"owners_signed"}, 3.0),
        (list(PEOPLE)[1:], {"reviewer_independent"}, 4.0),
    ],
)
def test_a_card_that_some_signed_waits_for_the_others(team, names, waits, measured):
    team.sign(team.complete(), names)
    report = team.judge()
    assert report.verdict == "PENDING_REVIEW"
    found = {c.id: c for c in report.criteria}
    assert {name for name, c in found.items() if c.verdict == "PENDING_REVIEW"} == waits
    assert all(c.verdict == "PASS" for name, c in found.items() if name not in waits)
    assert found["owners_signed"].measured == measured
    if "rita" not in names:
        assert "review and sign-off by rita" in found["reviewer_independent"].caveat


@pytest.mark.parametrize(
    ("change", "red"),
    [
        ({"reviewer": "sue"}, "reviewer_independent"),
        ({"reviewer": "ada"}, "reviewer_independent"),
        ({"reviewer": "pia"}, "reviewer_independent"),
        ({"spotter": "ada"}, "reviewer_independent"),
        ({"expires": "2026-11-20"}, "not_expired"),
        ({"force_limit_n": 1e9}, "envelope_within_limits"),
    ],
)
def test_whoever_has_still_to_sign_hides_nothing_that_is_wrong(team, change, red):
    team.sign(team.complete(), ["mo"])
    team.forge(_edit(**change), ["mo", "sam"])
    report = team.judge()
    assert report.verdict == "FAIL"
    assert {c.id for c in report.criteria if c.verdict == "FAIL"} == {red}


def test_a_card_that_lies_under_the_name_of_another_is_refused(signed):
    """Renamed with its file, as after `card.name` was changed and nothing was drafted again."""
    assert examine(signed.root, signed.envelope.name.partition(".")[0]).refusal == ""
    signed.envelope.rename(signed.envelope.with_name("another.dsse.json"))
    papers = examine(signed.root, "another")
    assert papers.refusal == "the card has another name than its file"
    assert papers.present and papers.signed is None


def test_thresholds_of_none_are_strict_and_pass(signed):
    known = json.loads((signed.root / "artifacts/card/card.json").read_bytes())["abort_thresholds"]
    signed.forge(_edit(abort_thresholds=dict.fromkeys(known, 0.0)))
    assert signed.judge().verdict == "PASS"


def test_somebody_whose_role_is_the_stop_may_stand_there(signed):
    signed.allow({**PEOPLE, **AUTHORS, "sue": "spotter"})
    signed.forge(_edit(spotter="sue"))
    report = signed.judge()
    assert report.verdict == "PASS"
    said = {c.id: c.caveat for c in report.criteria}["reviewer_independent"]
    assert "sue stands at the stop" in said


def test_a_force_limit_that_nothing_supports_is_said_beside_its_reason(signed):
    """Here a draft alone says so; the chain would have to say it too, or the card is not of it."""
    said = "no contact in 540 of 540 rollouts"
    caveat = f"flow: {said}, so that no force of it was ever seen."
    found = {c.id: c.caveat for c in signed.judge().criteria}["envelope_within_limits"]
    assert found == "as simulated, and no command beyond"
    draft = json.loads((signed.root / "artifacts/card/card.json").read_bytes())
    _redraft(signed, caveats=[*draft["caveats"], caveat])
    found = {c.id: c.caveat for c in signed.judge().criteria}["envelope_within_limits"]
    assert f"{said}: the force limit stands on the written reason alone" in found
    assert "(measured at this cell)" in found


def test_a_caveat_that_people_add_stays(signed):
    draft = json.loads((signed.root / "artifacts/card/card.json").read_bytes())
    signed.forge(_edit(caveats=["The floor is wet.", *reversed(draft["caveats"])]))
    assert signed.judge().verdict == "PASS"


def test_what_moved_since_the_plan_is_no_caveat_to_leave_out(signed):
    """Each caveat of the draft by itself, whatever else the card says."""
    draft = json.loads((signed.root / "artifacts/card/card.json").read_bytes())
    for left_out in draft["caveats"]:
        kept = [text for text in draft["caveats"] if text != left_out]
        signed.forge(_edit(caveats=[*kept, f"{left_out} "]))
        report = signed.judge()
        assert report.verdict == "FAIL", left_out
        said = {c.id: c.caveat for c in report.criteria}["signature_valid"]
        assert "caveats is without" in said and left_out[:40] in said


@pytest.mark.parametrize("day", [datetime.date(2026, 11, 19), datetime.date(2026, 12, 1)])
def test_outside_its_days_the_card_is_void(signed, day):
    report = signed.judge(today=day)
    assert report.verdict == "FAIL"
    assert _red(report) == {"not_expired"}


@pytest.mark.parametrize(
    ("path", "data", "criterion"),
    [
        ("card/card.json", b"{}", "upstream_passed"),
        ("reload/identity.json", None, "upstream_passed"),
        ("reload/identity.json", b'{"flow": 1}', "upstream_passed"),
        ("stress/envelope.json", None, "envelope_within_limits"),
    ],
)
def test_what_lacks_under_a_signed_card_is_named_and_no_fault_of_ours(
    signed, path, data, criterion
):
    evidence.replace(signed.root, path, data)
    report = signed.judge()
    assert report.verdict == "FAIL" and criterion in _red(report)


@pytest.mark.parametrize(("days", "good"), [(1, True), (0, False)])
def test_a_card_may_last_a_day_and_no_less(days, good):
    section = {"card": "trial", "maximum_days": days}
    if good:
        assert parse_section(CardGateSettings, section, where="gate_e").maximum_days == 1
    else:
        with pytest.raises(ConfigError, match="maximum_days"):
            parse_section(CardGateSettings, section, where="gate_e")


@pytest.mark.parametrize(("until", "days_beyond"), [("2026-12-31", False), ("2026-11-25", True)])
def test_a_card_does_not_outlive_the_exception_by_which_its_candidate_stands(
    signed, until, days_beyond
):
    draft = json.loads((signed.root / "artifacts/card/card.json").read_bytes())
    exception = {"owner": "model", "reason": "brought", "expires": until}

    def stands(params):
        params["gate_b"]["unmatched"] = {draft["candidate"]: exception}

    evidence.write_params(signed.root, stands)
    found = {c.id: c for c in signed.judge().criteria}["not_expired"]
    assert (found.verdict == "FAIL") == days_beyond
    assert ("outlives the exception" in found.caveat) == days_beyond
    others = {"gate_b": {"unmatched": {"another": exception}}}
    evidence.write_params(signed.root, lambda params: params["gate_b"].update(others["gate_b"]))
    assert {c.id: c for c in signed.judge().criteria}["not_expired"].verdict == "PASS"


def test_a_limit_that_is_overridden_stands_on_the_card_and_ends_it(team, monkeypatch):
    """The day before its end, the day itself, the day after; and no card outlives it."""
    root, last = team.root, datetime.date(2026, 11, 25)
    entry = {
        "gate": "D", "criterion": "hold_share_upper", "candidate": "flow", "limit": 0.06,
        "by": "rita", "reason": "the cell waits", "expires": str(last),
    }  # fmt: skip
    evidence.write_params(root, evidence.set_limit("gate_d", "hold_share_upper", 0.04))
    (root / "overrides.yaml").write_text(yaml.safe_dump({"overrides": [entry]}))
    write_bytes(root / report_path("D"), report_bytes(proof.judge(root, "D")))
    found = {gate: read_report(root, gate) for gate in "ABCD"}
    reports = {gate: report for gate, (report, _) in found.items()}
    hashes = {gate: digest for gate, (_, digest) in found.items()}
    monkeypatch.setattr(proof, "prove_chain", lambda root, through: (reports, hashes))
    card = draft(root, reports, hashes)
    write_bytes(root / "artifacts/card/card.json", card_bytes(card))
    evidence.record(root)
    assert card.caveats[1].startswith("OVERRIDDEN at gate D: hold_share_upper of flow")
    team.sign(team.complete(), PEOPLE)
    report = team.judge(today=last)
    assert _red(report) == {"not_expired"}, "valid to the 30th"
    team.envelope.unlink()
    team.sign(team.complete(expires=str(last)), PEOPLE)
    for day in (last - datetime.timedelta(1), last):
        report = team.judge(today=day)
        assert report.verdict == "PASS" and report.overrides == reports["D"].overrides
        assert "OVERRIDDEN: hold_share_upper by rita; without, gate D FAIL." in report.decision
        assert report.caveats[0] == card.caveats[1]
    report = team.judge(today=last + datetime.timedelta(1))
    assert _red(report) == {"upstream_passed", "not_expired"}
    assert "over since 2026-11-25" in report.criteria[0].caveat
    team.allow({**{n: r for n, r in PEOPLE.items() if n != "rita"}, **AUTHORS, "rita": "author"})
    assert "rita, an author" in team.judge(today=last).criteria[0].caveat
