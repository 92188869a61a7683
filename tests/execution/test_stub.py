"""The stub asks again by itself: with the executor's check asleep, it still refuses."""

import numpy as np
import pytest

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow.mutants import SCENARIOS
from genpolicy.evidence.shadow.rig import IMITATED, Rig, StandInContext
from genpolicy.execution.checks import CHECKS, Place, without
from genpolicy.execution.executor import Executor
from genpolicy.verification.checker import check_messages

PAST_THE_EXECUTOR = {"same_action", "sequence", "end_of_episode"}
SEEN_BY_THE_STUB = [
    check.name for check in CHECKS
    if Place.STUB in check.places and check.name not in PAST_THE_EXECUTOR
]  # fmt: skip


def half_asleep(check):
    """A rig whose executor lacks one check, while its stub has them all."""
    rig = Rig(checks=IMITATED if check != "issued" else CHECKS)
    asked = without(IMITATED if check != "issued" else CHECKS, check)
    rig.begin(Executor(rig.cell, rig.journal, rig.stub, checks=asked))
    return rig


@pytest.mark.parametrize("check", SEEN_BY_THE_STUB)
def test_the_stub_refuses_what_the_executor_lets_through(check):
    rig = half_asleep(check)
    SCENARIOS[check](rig)
    assert rig.stub.stale + rig.stub.invalid > 0
    refusals = sum(event.kind == "refuse" for event in rig.journal.events())
    assert refusals == rig.stub.stale + rig.stub.invalid
    assert rig.stub.arrivals == rig.stub.accepted + rig.stub.stale + rig.stub.invalid
    if check != "end_of_episode":
        rig.executor.end_episode(rig.now_s)
    accepted = [e for e in rig.journal.events() if e.kind in ("accept", "fallback")]
    report = check_messages(
        (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload})
        for e in rig.journal.events()
    )
    broken = {violation.rule for violation in report.violations}
    # No action passes; the checker still names what was enqueued.
    forged = {"action_hash": "P1.hash", "infeasible": "P1.admitted", "period": "P1.period"}
    if check in forged:
        assert accepted == [] and forged[check] in broken
    left = {rule for rule in broken if rule.startswith(("P1", "P5", "P7"))}
    assert left <= {forged.get(check)}


def test_another_action_than_the_admitted_row_is_invalid():
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    offer = {"source": "policy", "arrival": 0, "now_ns": 0}
    flipped = chunk.actions[0].copy()
    flipped[3] = np.nextafter(flipped[3], 1.0)
    assert rig.stub.offer(chunk, flipped, row=0, sequence=1, **offer) == "infeasible"
    assert rig.stub.offer(chunk, chunk.actions[1], row=0, sequence=2, **offer) == "infeasible"
    assert rig.stub.offer(chunk, chunk.actions[0], row=-1, sequence=3, **offer) == "infeasible"
    assert rig.stub.offer(chunk, chunk.actions[8], row=8, sequence=4, **offer) == "infeasible"
    assert rig.stub.invalid == 4 and rig.stub.accepted == 0
    assert rig.stub.offer(chunk, chunk.actions[0], row=0, sequence=5, **offer) is None


def test_sequence_and_due_time_never_go_back():
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    give = {"source": "policy", "arrival": 0}

    def offer(row, sequence, now_ns):
        return rig.stub.offer(
            chunk, chunk.actions[row], row=row, sequence=sequence, now_ns=now_ns, **give
        )

    assert offer(0, 5, 10_000_000) is None
    assert offer(0, 6, 20_000_000) == "out_of_order"
    assert offer(1, 5, 60_000_000) == "out_of_order"
    assert offer(1, 6, 60_000_000) is None
    assert rig.stub.stale == 2


def test_a_refusal_means_hold_and_discards_the_rest():
    rig = half_asleep("expired")
    rig.observe()
    rig.deliver(rig.chunk(valid_until_s=0.06))
    assert [c.kind for c in rig.tick(4)] == ["action", "action", "hold", "hold"]
    assert rig.executor.conservation().rest_discarded == {"expired": 1}


@pytest.mark.parametrize("name, there", [("phase", "insert"), ("epoch", "epoch-2")])
def test_the_stub_remembers_a_change_that_was_taken_back(name, there):
    rig = Rig()
    rig.observe()
    old, home = rig.chunk(), getattr(rig, name)
    for value in (there, home):
        rig.advance(0.01)
        setattr(rig, name, value)
        rig.observe()
    reason = rig.stub.offer(
        old, old.actions[0], row=0, source="policy", arrival=0, sequence=1, now_ns=rig.now_ns
    )
    assert reason in ("phase_transition", "calibration_mismatch") and rig.stub.stale == 1


def test_the_stub_remembers_every_voiding_event():
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    rig.advance(0.01)
    rig.executor.force_event(rig.now_s)
    rig.stub.void(DiscardReason.COLLISION_EVENT, 0)  # an older event
    offer = {"row": 0, "source": "policy", "arrival": 0, "sequence": 1, "now_ns": rig.now_ns}
    assert rig.stub.offer(chunk, chunk.actions[0], **offer) == "force_event"


def test_the_stub_takes_nothing_from_before_a_reset():
    rig = Rig()
    rig.advance(0.1)
    rig.executor.reset(rig.now_s)
    rig.observe(age_s=0.05)
    chunk = rig.chunk(condition_observation_event_time_s=0.05)
    offer = {"row": 0, "source": "policy", "arrival": 0, "sequence": 1, "now_ns": rig.now_ns}
    assert rig.stub.offer(chunk, chunk.actions[0], **offer) == "reset"


def test_what_the_session_before_a_reset_saw_is_seen_by_nobody_after_it():
    """At the moment of the reset itself: what was seen then is not void by its time."""
    rig = Rig()
    rig.advance(0.1)
    rig.observe()
    rig.executor.reset(rig.now_s)
    chunk = rig.chunk()
    assert chunk.metadata.session_epoch == 1
    offer = {"row": 0, "source": "policy", "arrival": 0, "now_ns": rig.now_ns}
    assert rig.stub.offer(chunk, chunk.actions[0], sequence=1, **offer) == "future_observation"
    assert rig.deliver(chunk) is DiscardReason.FUTURE_OBSERVATION
    rig.observe()
    assert rig.stub.offer(chunk, chunk.actions[0], sequence=2, **offer) is None


@pytest.mark.parametrize("name, there", [("phase", "insert"), ("epoch", "epoch-2")])
def test_what_a_session_begins_in_is_no_change(name, there):
    """Another phase or calibration than before the reset voids nothing that the session saw."""
    rig = Rig()
    rig.observe()
    rig.advance(0.1)
    rig.executor.reset(rig.now_s)
    setattr(rig, name, there)
    chunk = rig.chunk()
    rig.advance(0.01)
    rig.observe()
    offer = {"row": 0, "source": "policy", "arrival": 0, "now_ns": rig.now_ns}
    assert rig.deliver(chunk) is None
    assert rig.stub.offer(chunk, chunk.actions[0], sequence=1, **offer) is None


@pytest.mark.parametrize("person", [True, False])
def test_after_a_person_the_last_command_says_nothing_of_where_the_arm_is(person):
    """A chunk from where the person left the arm goes on; without a person nothing led there."""
    rig = Rig()
    rig.run(2)
    if person:
        rig.executor.intervene(rig.now_s)
        rig.advance(0.1)
        rig.executor.hand_back(rig.now_s)
    rig.observe(tcp_m=[0.3, 0.3, 0.3])
    elsewhere = StandInContext(last_action=np.full(10, 0.3), measured_at_s=rig.now_s)
    chunk = rig.chunk(predecessor_chunk_id="", context=elsewhere)
    if not person:
        offer = {"row": 0, "source": "policy", "arrival": 9, "sequence": 99, "now_ns": rig.now_ns}
        assert rig.stub.offer(chunk, chunk.actions[0], **offer) == "broken_predecessor"
    assert rig.deliver(chunk) is None
    assert rig.tick()[0].kind == ("action" if person else "hold")


@pytest.mark.parametrize("told_ns", [0, 49_999_999])
def test_a_chunk_is_as_old_as_the_session_says_and_not_as_the_executor_does(told_ns):
    """By a time within its window it would be right on time; that time is over."""
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    rig.advance(0.5)
    rig.observe()
    offer = {"row": 0, "source": "policy", "arrival": 0, "sequence": 1, "now_ns": told_ns}
    assert rig.stub.offer(chunk, chunk.actions[0], **offer) == "expired"
    assert rig.journal.events()[-1].t == rig.now_ns and rig.stub.accepted == 0


@pytest.mark.parametrize(
    "bad", [{"row": None}, {"row": "0"}, {"row": True}, {"sequence": "x"}, {"sequence": 1.0},
            {"source": []}, {"source": "nobody"}, {"source": None}],
)  # fmt: skip
def test_an_offer_of_other_kinds_is_refused_and_never_raises(bad):
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    offer = {"row": 0, "source": "policy", "arrival": 0, "sequence": 1, "now_ns": 0}
    assert rig.stub.offer(chunk, chunk.actions[0], **offer | bad) == "infeasible"
    for nothing in (None, 3, object()):
        assert rig.stub.offer(nothing, chunk.actions[0], **offer) == "infeasible"
    assert rig.stub.accepted == 0 and rig.stub.invalid == 4


@pytest.mark.parametrize("event", ["force_event", "collision_event", "diverge", "stop"])
def test_what_was_here_at_an_event_is_refused_though_it_was_seen_as_late(event):
    """The executor has forgotten that it happened, at the very time of the observation."""
    names = [check.name for check in CHECKS if check.name.startswith("after_")]
    rig = Rig(checks=without(IMITATED, *names), stub_checks=IMITATED)
    rig.tick(1)
    rig.observe()
    rig.deliver(rig.chunk())
    if event == "diverge":
        rig.observe(divergence_m=1.0)
    elif event == "stop":
        rig.supervisor.emergency_stop(rig.now_s)
        rig.supervisor.human_reset(rig.now_s, "spotter")
    else:
        getattr(rig.executor, event)(rig.now_s)
    rig.tick(2)
    assert rig.stub.accepted == 0 and rig.stub.stale == 1
    rig.observe()
    rig.deliver(rig.chunk(predecessor_chunk_id=""))
    rig.tick(1)
    assert rig.stub.accepted == 1
