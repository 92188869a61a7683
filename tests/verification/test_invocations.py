"""The virtual clock's debts: nothing is judged before its time; each further candidate costs."""

import hashlib
from dataclasses import replace

import pytest

from genpolicy.candidates.wire.faults import Fault
from genpolicy.verification.expected import ExpectedSettings
from genpolicy.verification.invocations import FAULTS, Invocations
from genpolicy.verification.terms import TERMS

MS = 1_000_000
SESSION = ("session", {"t": 0, "labels": {"start_sha256": "ab"}})
BEGIN = ("invocation", {"t": 100 * MS, "id": "a", "stage": "begin", "detail": "0.06"})
CHECK = ("invocation", {"t": 200 * MS, "id": "a", "stage": "check", "detail": "0.03"})
FIRST = ("candidate", {"t": 200 * MS, "chunk_id": "a", "index": 0})
SECOND = ("candidate", {"t": 200 * MS, "chunk_id": "a", "index": 1})
QUEUED = ("enqueue", {"t": 200 * MS, "chunk_id": "a", "source": "policy",
                      "condition_ns": 100 * MS, "start_ns": 100 * MS})  # fmt: skip
FAULT = ("invocation", {"t": 250 * MS, "id": "a", "stage": "fault", "detail": "late"})
MISSED = ("invocation", {"t": 250 * MS, "id": "a", "stage": "end", "detail": "deadline"})
OTHER = ("invocation", {"t": 250 * MS, "id": "b", "stage": "begin", "detail": "0.06"})
END = ("end", {"t": 400 * MS})
ANSWERED = ("invocation", {"t": 200 * MS, "id": "a", "stage": "end", "detail": "answered"})

EXPECTED = ExpectedSettings(
    execution_horizon=8, action_period_s=0.05, maximum_age_s={}, watchdog_s=0.2, queue_capacity=2,
    controller_mode="m", replan_lead_rows=3, late_chunk={}, force_limit_n={},
    maximum_divergence_m=0.05, maximum_scene_shift_m=0.02, deadline_s=0.15,
)  # fmt: skip

SAW = {"t": 101 * MS, "exposed_ns": 100 * MS, "rows": 1, "history": "00" * 8}
SEEN = [
    ("exposure", {"t": 100 * MS, "sha256": hashlib.sha256(bytes(8)).hexdigest()}),
    ("arrived", {"t": 101 * MS, "exposed_ns": 100 * MS}),
]


def terms_of(begun):
    """Terms of an invocation whose observation was 1 ms on its way; it may take no number."""
    seconds = begun["detail"].removesuffix("soon") or "0"
    sampled = {"capture_s": 0.001, "sample_s": float(seconds) - 0.001}
    return {"t": begun["t"], "id": begun["id"], **dict.fromkeys(TERMS, 0.0), **sampled}


def rules(*events, session=SESSION, deadline_s=None):
    held = None if deadline_s is None else replace(EXPECTED, deadline_s=deadline_s)
    seen = Invocations(held)
    told = [session, *SEEN]
    for event in events:
        told.append(event)
        if event[1].get("stage") == "begin":
            told.append(("latency", terms_of(event[1])))
            told.append(("conditioning", {**SAW, "id": event[1]["id"]}))
    return [rule for kind, message in told for rule, _ in seen.follow(kind, message)]


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
        ((BEGIN, FIRST, changed(QUEUED, t=159 * MS)), "clock.early"),
        ((BEGIN, FIRST, CHECK, changed(SECOND, t=189 * MS)), "clock.early"),
        ((BEGIN, FIRST, SECOND), "clock.check"),
        ((BEGIN, CHECK, FIRST), "clock.check"),
        ((CHECK,), "clock.unknown"),
        ((FIRST,), "clock.unknown"),
        ((QUEUED,), "clock.unknown"),
        ((BEGIN, QUEUED), "clock.unknown"),
        ((BEGIN, changed(BEGIN, detail="1e-12"), FIRST), "clock.begin"),
        ((BEGIN, FIRST, ANSWERED, CHECK, SECOND), "clock.order"),
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


def test_a_fault_is_a_missed_deadline():
    assert rules(BEGIN, FAULT, MISSED, OTHER, END) == []
    assert rules(BEGIN, FAULT, changed(MISSED, detail="overrun"), END) == []


@pytest.mark.parametrize("events", [
    (BEGIN, FAULT, END), (BEGIN, FAULT, OTHER), (BEGIN, FAULT, FAULT, MISSED),
    (BEGIN, FAULT, changed(MISSED, detail="answered")),
    (BEGIN, FAULT, changed(MISSED, id="b")),
    (BEGIN, changed(FAULT, detail="tired"), MISSED),
    (BEGIN, FAULT, MISSED, changed(FIRST, t=300 * MS)),
    (BEGIN, FIRST, FAULT, MISSED),
    (BEGIN, FAULT, MISSED, FAULT, MISSED),
])  # fmt: skip
def test_a_fault_that_costs_no_deadline_or_that_was_answered_is_found(events):
    assert "clock.fault" in rules(*events)


def test_the_kinds_are_those_of_the_wire():
    assert set(FAULTS) == set(map(str, Fault))


def test_a_sum_of_seconds_may_round_by_less_than_a_microsecond():
    assert rules(BEGIN, changed(FIRST, t=160 * MS - 900)) == []
    assert rules(BEGIN, changed(FIRST, t=160 * MS - 1_100)) == ["clock.early"]


def test_a_session_without_a_clock_owes_nothing_and_one_with_a_clock_states_every_time():
    shadow = ("session", {"t": 0, "labels": {"fixture": "held_out"}})
    silent = changed(BEGIN, detail="")
    assert rules(silent, changed(FIRST, t=0), changed(QUEUED, t=0), session=shadow) == []
    with pytest.raises(ValueError, match="could not convert"):
        rules(silent)


def test_an_answer_that_comes_behind_the_deadline_is_right_and_a_fallback_owes_nothing():
    late = changed(ANSWERED, detail="deadline")
    assert rules(BEGIN, late, FIRST, QUEUED) == []
    assert rules(BEGIN, late, FIRST, ANSWERED, QUEUED) == ["clock.end"]
    assert rules(changed(QUEUED, source="fallback", t=0)) == []


def test_what_is_unreadable_is_no_number_of_seconds():
    with pytest.raises(ValueError, match="could not convert"):
        rules(changed(BEGIN, detail="soon"))


def tick(at_ms):
    return "observation", {"t": round(at_ms * MS)}


TICKS = [tick(at_ms) for at_ms in range(100, 500, 50)]


def clock(*told, deadline_s=None):
    """What is said of the clock alone: the ticks here expose nothing."""
    return [rule for rule in rules(*told, deadline_s=deadline_s) if rule.startswith("clock.")]


def among_ticks(*events):
    return sorted([*TICKS, *events], key=lambda event: event[1]["t"])


@pytest.mark.parametrize(("end", "at_ms", "found"), [
    ("deadline", 250, []), ("deadline", 200, ["clock.deadline"]),
    ("deadline", 300, ["clock.deadline"]), ("deadline", 400, ["clock.deadline"]),
    ("answered", 250, []), ("answered", 300, ["clock.deadline"]),
    ("overrun", 200, []), ("overrun", 300, ["clock.deadline"]),
    ("done", 250, ["clock.end"]),
])  # fmt: skip
def test_an_invocation_is_given_up_at_the_first_tick_beyond_its_deadline(end, at_ms, found):
    """Exposed at 100 ms with 150 ms: it is over at the tick of 250 ms, which gives it up."""
    told = among_ticks(BEGIN, changed(MISSED, t=at_ms * MS, detail=end))
    assert clock(*told, deadline_s=0.15) == found
    assert clock(*told) == [rule for rule in found if rule == "clock.end"]


def test_one_that_never_ends_is_no_miss_that_nobody_counts():
    assert clock(*among_ticks(BEGIN), deadline_s=0.15) == ["clock.deadline"]
    assert clock(*among_ticks(BEGIN, MISSED, MISSED), deadline_s=0.15) == ["clock.end"]


def test_one_that_began_with_an_old_observation_has_a_tick_to_answer():
    """What it saw was 200 ms on its way: there was no tick between begin and answer."""
    begin, end = changed(BEGIN, t=300 * MS), changed(MISSED, t=350 * MS)
    for detail in ("answered", "deadline"):
        told = among_ticks(begin, changed(end, detail=detail))
        assert clock(*told, deadline_s=0.15) == []
    assert clock(*among_ticks(begin, changed(end, t=400 * MS)), deadline_s=0.15) == [
        "clock.deadline"
    ]


def test_a_term_that_took_too_long_ends_it_at_the_tick_behind():
    over = ("invocation", {"t": 250 * MS, "id": "a", "stage": "overrun",
                           "detail": "sample skip_invocation"})  # fmt: skip
    ended = changed(MISSED, t=300 * MS, detail="overrun")
    assert clock(*among_ticks(BEGIN, over, ended), deadline_s=0.15) == []


def test_times_of_ticks_are_rounded():
    assert rules(BEGIN, changed(MISSED, t=250 * MS - 2), deadline_s=0.15) == []
    assert rules(BEGIN, changed(MISSED, t=250 * MS - 3), deadline_s=0.15) == ["clock.deadline"]
    for before_ns, found in ((2, ["clock.deadline"]), (3, [])):
        told = (BEGIN, tick(250 - before_ns / MS), tick(300))
        assert clock(*told, deadline_s=0.15) == found
