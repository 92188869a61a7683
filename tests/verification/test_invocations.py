"""The virtual clock's debts: nothing is judged before its time; each further candidate costs."""

import pytest

from genpolicy.verification.invocations import Invocations

MS = 1_000_000
BEGIN = ("invocation", {"t": 100 * MS, "id": "a", "stage": "begin", "detail": "0.06"})
CHECK = ("invocation", {"t": 200 * MS, "id": "a", "stage": "check", "detail": "0.03"})
FIRST = ("candidate", {"t": 200 * MS, "chunk_id": "a", "index": 0})
SECOND = ("candidate", {"t": 200 * MS, "chunk_id": "a", "index": 1})
QUEUED = ("enqueue", {"t": 200 * MS, "chunk_id": "a"})


def rules(*events):
    seen = Invocations()
    return [rule for kind, message in events for rule, _ in seen.follow(kind, message)]


def changed(event, **to):
    return event[0], {**event[1], **to}


def test_an_answer_in_its_time_is_right():
    assert rules(BEGIN, FIRST, QUEUED) == []
    assert rules(BEGIN, FIRST, CHECK, SECOND, QUEUED) == []
    assert rules(BEGIN, changed(FIRST, t=160 * MS), changed(QUEUED, t=160 * MS)) == []


@pytest.mark.parametrize(
    ("events", "rule"),
    [
        ((BEGIN, changed(FIRST, t=159 * MS)), "clock.early"),
        ((BEGIN, changed(QUEUED, t=159 * MS)), "clock.early"),
        ((BEGIN, FIRST, CHECK, changed(SECOND, t=189 * MS)), "clock.early"),
        ((BEGIN, FIRST, SECOND), "clock.check"),
        ((BEGIN, CHECK, FIRST), "clock.check"),
        ((CHECK,), "clock.check"),
        ((BEGIN, FIRST, changed(CHECK, detail="0.0"), SECOND), "clock.check"),
        ((BEGIN, FIRST, changed(CHECK, detail="nan"), SECOND), "clock.check"),
        ((changed(BEGIN, detail="0.0"),), "clock.latency"),
        ((changed(BEGIN, detail="nan"),), "clock.latency"),
        ((BEGIN, FIRST, FIRST), "clock.order"),
        ((BEGIN, CHECK, SECOND), "clock.order"),
    ],
)
def test_what_comes_too_cheap_is_found(events, rule):
    assert rule in rules(*events)


def test_a_sum_of_seconds_may_round_by_less_than_a_microsecond():
    assert rules(BEGIN, changed(FIRST, t=160 * MS - 900)) == []
    assert rules(BEGIN, changed(FIRST, t=160 * MS - 1_100)) == ["clock.early"]


def test_without_a_stated_time_nothing_is_owed():
    silent = changed(BEGIN, detail="")
    assert rules(silent, changed(FIRST, t=0), changed(QUEUED, t=0)) == []
    assert rules(changed(FIRST, t=0), changed(QUEUED, t=0)) == []


def test_what_is_unreadable_is_no_number_of_seconds():
    with pytest.raises(ValueError, match="could not convert"):
        rules(changed(BEGIN, detail="soon"))
