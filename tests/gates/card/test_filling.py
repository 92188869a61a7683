import datetime
from dataclasses import replace

import pytest
from team import FILLED, TODAY

from gates.card.card import card_bytes
from gates.card.filling import (
    NONCE_BYTES,
    Rules,
    answer,
    filled,
    questions,
    require_fillable,
    rules_of,
)
from gates.card.people import load_allow_list
from gates.card.signing import read_draft, sign_card
from genpolicy.errors import BadInputError, ConfigError

ANSWERS = {
    name: str(FILLED[name])
    for name in (
        "force_limit_n",
        "force_limit_reason",
        "spotter",
        "stop_path",
        "reviewer",
        "expires",
    )
}


@pytest.fixture
def rules(team):
    return Rules(read_draft(team.root), load_allow_list(team.root), TODAY, 30)


def test_what_was_answered_and_nothing_else_is_in_the_card(rules):
    card = filled(rules, ANSWERS)
    draft = rules.draft.model_dump()
    changed = {name for name, value in card.model_dump().items() if value != draft[name]}
    assert changed == {*ANSWERS, "not_before", "nonce"}
    assert card.force_limit_n == 30.0
    assert card.not_before == TODAY.isoformat()
    assert card.abort_thresholds == rules.draft.abort_thresholds


def test_a_nonce_is_drawn_for_each(rules):
    first, second = filled(rules, ANSWERS).nonce, filled(rules, ANSWERS).nonce
    assert first != second
    assert len(first) == 2 * NONCE_BYTES


def test_what_is_filled_can_be_signed(team, rules):
    path = team.root / "completed.json"
    path.write_bytes(card_bytes(filled(rules, ANSWERS)))
    envelope = sign_card(team.root, card_file=path, key_file=team.folder / "rita", reviewer="rita")
    assert envelope.is_file()


def test_a_force_without_contact_is_asked_for_with_what_was_seen(rules):
    """Nothing is answered for anybody; and whoever answers is told that nothing supports it."""
    reason = next(q for q in questions(rules) if q.name == "force_limit_reason").text
    assert "contact in" not in reason
    said = "no contact in 540 of 540 rollouts"
    caveat = f"{rules.draft.candidate}: {said}, so that no force of it was ever seen."
    draft = rules.draft.model_copy(update={"caveats": (*rules.draft.caveats, caveat)})
    unseen = replace(rules, draft=draft)
    reason = next(q for q in questions(unseen) if q.name == "force_limit_reason").text
    assert f"{said}: the evidence supports no force, so write why" in reason
    with pytest.raises(ConfigError, match=f"force_limit_reason is not answered, .*{said}"):
        filled(unseen, {n: said for n, said in ANSWERS.items() if n != "force_limit_reason"})
    assert caveat in filled(unseen, ANSWERS).caveats


def test_thresholds_of_none_are_strict_and_allowed(rules):
    """A trial that ends at the first of anything; what nobody asked for is no threshold."""
    none = {f"abort.{name}": "0" for name in rules.draft.abort_thresholds}
    assert set(filled(rules, {**ANSWERS, **none}).abort_thresholds.values()) == {0.0}


def test_a_threshold_may_be_lowered(rules):
    name = sorted(rules.draft.abort_thresholds)[0]
    most = rules.draft.abort_thresholds[name]
    card = filled(rules, {**ANSWERS, f"abort.{name}": repr(most / 2)})
    assert card.abort_thresholds == {**rules.draft.abort_thresholds, name: most / 2}
    with pytest.raises(ConfigError, match="lowered, never raised"):
        filled(rules, {**ANSWERS, f"abort.{name}": repr(most * 1.001)})


@pytest.mark.parametrize(
    ("name", "said"),
    [
        *(
            ("force_limit_n", said)
            for said in ("0", "-1", "80.1", "1e9", "1e308", "1e309", "nan", "inf", "")
        ),
        *(
            ("spotter", said)
            for said in ("", "  ", "-", "\u200b\u200b", "sam\u202e", "Sam", "rita", "ada", "nobody")
        ),
        *(("stop_path", said) for said in ("", "--")),
        *(("force_limit_reason", said) for said in ("", "?")),
        *(("reviewer", said) for said in ("", "nobody", "ada", "mo", "Rita")),
        *(
            ("expires", said)
            for said in ("", "2026-11-20", "2026-12-21", "21.11.2026", "2026-02-30")
        ),
        *(("not_before", said) for said in ("", "tomorrow", "2026-13-01")),
        ("abort.latency_s", "nan"),
        ("abort.latency_s", "-1"),
        ("abort.latency_s", "soon"),
    ],
)
def test_an_answer_that_signing_would_refuse_is_refused_at_once(rules, name, said):
    with pytest.raises(ConfigError, match=f"the card's {name}"):
        answer(rules, name, said, {"not_before": TODAY.isoformat()})


@pytest.mark.parametrize(
    ("name", "said", "action"),
    [
        ("force_limit_n", "1e9", "measured for this cell"),
        ("force_limit_n", "30 N", "without the unit"),
        ("force_limit_reason", "--", "Write it out"),
        ("spotter", "nobody", "not on it yet is entered in review"),
        ("spotter", "rita", "Name an owner"),
        ("reviewer", "nobody", "genpolicy card keygen"),
        ("expires", "soon", "at most 30 in all"),
        ("not_before", "2026-11-31", "Give a day from 2026-11-21 on"),
        ("abort.latency_s", "9", "another limit is planned, and run, before"),
    ],
)
def test_each_refusal_of_an_answer_says_what_to_do(rules, name, said, action):
    with pytest.raises(ConfigError) as refused:
        answer(rules, name, said, {"not_before": TODAY.isoformat()})
    assert action in refused.value.action


def test_a_refusal_of_a_card_says_what_to_do(rules):
    with pytest.raises(ConfigError) as refused:
        filled(rules, {**ANSWERS, "nonce": "1"})
    assert "is fixed by the draft, or drawn" in refused.value.action
    with pytest.raises(ConfigError) as refused:
        filled(rules, {})
    assert "--set force_limit_n=" in refused.value.action
    nobody = replace(rules, draft=rules.draft.model_copy(update={"task": ""}))
    with pytest.raises(ConfigError) as refused:
        filled(nobody, ANSWERS)
    assert "section `card` of params.yaml" in refused.value.action
    made_it = replace(rules, draft=rules.draft.model_copy(update={"authors": ("rita",)}))
    with pytest.raises(ConfigError) as refused:
        answer(made_it, "reviewer", "rita", {})
    assert "did not make the candidate" in refused.value.action


@pytest.mark.parametrize(
    ("first", "last"),
    [("2026-11-21", "2026-11-21"), ("2026-11-20", "2026-11-30"), ("2026-12-05", "2027-01-03")],
)
def test_days_of_a_card_that_will_be_valid_are_taken(rules, first, last):
    card = filled(rules, {**ANSWERS, "not_before": first, "expires": last})
    assert (card.not_before, card.expires) == (first, last)


def test_more_days_than_a_card_may_have_are_refused(rules):
    with pytest.raises(ConfigError, match="valid for more than 30 days"):
        filled(rules, {**ANSWERS, "not_before": "2026-12-05", "expires": "2027-01-04"})


@pytest.mark.parametrize("name", ANSWERS)
def test_nothing_without_a_default_is_answered_for_a_person(rules, name):
    asked = {question.name: question for question in questions(rules)}
    assert asked[name].proposed is None
    rest = {other: said for other, said in ANSWERS.items() if other != name}
    with pytest.raises(ConfigError, match=f"the card's {name} is not answered"):
        filled(rules, rest)


@pytest.mark.parametrize("name", ["speed_limit_m_s", "caveats", "abort.nothing", "nonce"])
def test_what_the_draft_fixes_cannot_be_answered(rules, name):
    with pytest.raises(ConfigError, match=f"the card's {name} is not asked"):
        filled(rules, {**ANSWERS, name: "1"})


def test_a_rehearsal_is_refused_before_anything_is_asked(team):
    params = team.root / "params.yaml"
    params.write_text("rehearsal: true\n" + params.read_text())
    with pytest.raises(BadInputError, match=r"params\.yaml is a rehearsal") as refused:
        rules_of(team.root, TODAY)
    assert "of a rehearsal none is signed" in refused.value.action


@pytest.mark.parametrize(
    ("authors", "people", "where", "action"),
    [
        ((), None, "authors is empty in the draft", "params.yaml: card.authors"),
        (("ada", "eve"), None, "authors is 'eve'", "Have the entry of every author committed"),
        (("ada",), ("mo", "ada"), "reviewer is nobody", "genpolicy card keygen"),
        (("ada", "rita"), None, "reviewer is nobody", "genpolicy card keygen"),
    ],
)
def test_a_draft_that_no_answers_complete_is_refused_first(rules, authors, people, where, action):
    """As shipped: whoever was named as reviewer was refused, one after the other."""
    allowed = rules.allowed
    if people is not None:
        kept = tuple(person for person in allowed.people if person.id in people)
        allowed = allowed.model_copy(update={"people": kept})
    draft = rules.draft.model_copy(update={"authors": authors})
    for ask in (require_fillable, lambda rules: filled(rules, ANSWERS)):
        with pytest.raises(ConfigError, match=f"the card's {where}") as refused:
            ask(replace(rules, draft=draft, allowed=allowed))
        assert action in refused.value.action
    require_fillable(rules)


def test_the_rules_are_those_of_the_workspace(team):
    found = rules_of(team.root, datetime.date(2026, 11, 22))
    assert found.draft == read_draft(team.root)
    assert found.allowed == load_allow_list(team.root)
    assert found.maximum_days == 30
