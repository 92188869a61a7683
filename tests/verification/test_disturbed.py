"""A push that never came, or another one: what happened to the cell is held against the plan."""

import pytest

from genpolicy.evidence.stress.perturbations import RecoveryDrill, SidewaysPush, drill_s, pushes
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.verification.disturbed import Plan, disturbed_otherwise

SEED, PERIOD_NS = 7, 50_000_000
PUSH = SidewaysPush(force_n=15.0, contact_force_n=30.0)
PLANNED = {
    "nominal": {"kind": "nominal"}, "push": PUSH.model_dump(),
    "recovery_drill": RecoveryDrill().model_dump(),
}  # fmt: skip
PLAN = Plan(PLANNED, frozenset({"insert"}), SEED)
OPEN, CONTACT = pushes(PUSH, root_seed=SEED, name="push", start=0)
DRILL_S = drill_s(RecoveryDrill(), root_seed=SEED, name="recovery_drill", start=0)
TOUCHES, ENDS = 40, 100
"""Ticks at which contact begins, and the rollout ends."""


def _tick(seconds):
    """The first tick that is not before."""
    return -int(-seconds * 1e9 // PERIOD_NS)


def _push(push, **changes):
    said = {"force_n": push.force_n, "duration_s": push.duration_s, "in_contact": push.in_contact}
    return "push", said | changes


def _recovery(old, new, cause="drill"):
    return "recovery", {"old": old, "new": new, "cause": cause, "phase": "", "failures": 0}


FIRST, SECOND = _tick(OPEN.time_s), TOUCHES + _tick(CONTACT.time_s)
DUE = _tick(DRILL_S)
PUSHED = {FIRST: [_push(OPEN)], SECOND: [_push(CONTACT)]}
DRILLED = {DUE: [_recovery("idle", "hold")]}


@pytest.fixture
def found(tmp_path):
    """What is said of one rollout in which this happens, by tick."""

    def ask(condition, happens, *, ends=ENDS, touches=TOUCHES):
        labels = {"method": "flow", "perturbation": condition, "start": "0"}
        journal = Journal("flow", labels)
        journal.add("session", 0, {"labels": labels, "period_ns": PERIOD_NS})
        for tick in range(ends):
            phase = "insert" if tick >= touches else "approach"
            journal.add("observation", tick * PERIOD_NS, {"phase": phase})
            for kind, payload in happens.get(tick, []):
                journal.add(kind, tick * PERIOD_NS, payload)
        # A rollout that is stopped ends within a tick: it has seen it, and nothing else happens.
        journal.add("observation", ends * PERIOD_NS, {"phase": "approach"})
        journal.add("end", ends * PERIOD_NS, {})
        write_journal(tmp_path / "journal.mcap", [journal])
        return list(disturbed_otherwise(tmp_path / "journal.mcap", PLAN))

    return ask


def test_what_was_planned_happened(found):
    assert found("push", PUSHED) == found("nominal", {}) == []
    assert found("recovery_drill", DRILLED) == []


@pytest.mark.parametrize("happens", [
    {}, {FIRST: [_push(OPEN)]}, {SECOND: [_push(CONTACT)]},
    PUSHED | {FIRST + 1: [_push(OPEN)]},
    {FIRST + 1: [_push(OPEN)], SECOND: [_push(CONTACT)]},
    PUSHED | {FIRST: [_push(OPEN, force_n=-OPEN.force_n)]},
    PUSHED | {FIRST: [_push(OPEN, force_n=0.9 * OPEN.force_n)]},
    PUSHED | {SECOND: [_push(CONTACT, duration_s=0.1)]},
    PUSHED | {SECOND: [_push(CONTACT, in_contact=False)]},
])  # fmt: skip
def test_a_push_that_is_missing_or_another_one_is_found(found, happens):
    (said,) = found("push", happens)
    assert said.startswith("'flow' was pushed") and said.endswith(
        f"{OPEN.force_n:+g} N at {FIRST * 0.05:.3f} s, "
        f"{CONTACT.force_n:+g} N at {SECOND * 0.05:.3f} s by the plan"
    )


def test_nobody_is_pushed_or_drilled_where_nothing_is_planned(found):
    (said,) = found("nominal", {FIRST: [_push(OPEN)]})
    assert said.endswith("never by the plan")
    (said,) = found("push", PUSHED | DRILLED)
    assert "had a drill" in said


def test_a_rollout_that_ends_or_never_touches_is_owed_no_push_after_that(found):
    assert found("push", {}, ends=FIRST) == []
    assert found("push", {}, ends=FIRST + 1) != [], "it was there at that tick"
    assert found("push", {FIRST: [_push(OPEN)]}, ends=SECOND) == []
    assert found("push", {FIRST: [_push(OPEN)]}, touches=ENDS) == []


def test_a_drill_comes_at_the_first_tick_at_which_recovery_is_idle(found):
    silent = [_recovery("idle", "hold", "silence")]
    assert "idle when its drill" in found("recovery_drill", {})[0]
    assert found("recovery_drill", {}, ends=DUE) == []
    assert "idle when" in found("recovery_drill", {}, ends=DUE + 1)[0]
    assert "one due" in found("recovery_drill", {DUE - 1: DRILLED[DUE]})[0]
    assert "idle when" in found("recovery_drill", {DUE + 1: DRILLED[DUE]})[0]
    back = {DUE + 3: [_recovery("hold", "idle", "recovered")]}
    assert found("recovery_drill", {DUE: silent}) == [], "recovery was under way ever since"
    assert "idle when" in found("recovery_drill", {DUE: silent} | back)[0]
    assert found("recovery_drill", {DUE: silent} | back | {DUE + 4: DRILLED[DUE]}) == []
    assert found("recovery_drill", DRILLED | back) == [], "once is enough"
    twice = DRILLED | back | {DUE + 9: DRILLED[DUE]}
    assert "one due" in found("recovery_drill", twice)[0]
