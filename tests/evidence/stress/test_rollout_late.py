"""Answers that come late: each phase says what becomes of them, and nobody waits for ever."""

from collections import Counter
from dataclasses import replace

import pytest

from genpolicy.evidence.stress.perturbations import NetworkJitter
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.state import Outcome
from genpolicy.execution.cell import ExecutionSettings

LATE_S, IN_TIME_S = 0.2, 0.03


def of_kind(rollout, kind):
    return [event for event in rollout.journal.events() if event.kind == kind]


def begins(rollout):
    """Rows with which the chunks of the policy began."""
    made = [event.payload for event in of_kind(rollout, "enqueue")]
    return Counter(chunk["checked_rows"][0] for chunk in made if chunk["source"] == "policy")


def recoveries(rollout):
    """When recovery began, s, and why."""
    begun = [e for e in of_kind(rollout, "recovery") if e.payload["old"] == "idle"]
    return [(event.t / 1e9, event.payload["cause"]) for event in begun]


@pytest.fixture(scope="module")
def declaring(kit):
    """The settings with one word for all phases."""

    def make(what):
        phases = list(kit.EXECUTION.force_limit_n)
        return ExecutionSettings(**kit.PARAMS["execution"] | {"late_chunk": {what: phases}})

    return make


@pytest.fixture
def play(run, kit, plans, declaring, tmp_path):
    """A rollout that the checker finds nothing in, under one word for all phases."""

    def go(what, seconds=LATE_S, **changes):
        execution = declaring(what)
        (rollout,) = run(
            kit.Replay(plans.actions), execution=execution, latency=kit.latency(seconds), **changes
        )
        report = kit.check([rollout], tmp_path, execution=execution)
        assert report.violations == [] and rollout.executor.conservation().error == 0
        assert rollout.stub.stale == rollout.stub.invalid == 0
        return rollout

    return go


def test_where_it_continues_a_late_chunk_begins_at_a_later_row(play, kit):
    rollout = play("continue", ticks=60)
    assert rollout.tally.action_ticks > 0
    assert min(begins(rollout)) > kit.EXECUTION.replan_lead_rows


def test_where_it_holds_none_begins_and_silence_leads_to_recovery(play, kit):
    """Only late chunks, ever: the arm holds, recovers, and at last a person is asked."""
    rollout = play("hold")
    assert rollout.tally.action_ticks == 0 and not begins(rollout)
    assert rollout.executor.conservation().chunks.discarded["expired"] > 0
    causes = recoveries(rollout)
    assert causes[0] == (pytest.approx(kit.EXECUTION.hold_before_recovery_s), "silence")
    assert {cause for _, cause in causes} == {"silence"}
    assert rollout.outcome is Outcome.INTERVENTION


def test_where_it_falls_back_recovery_begins_with_the_late_chunk(play, kit):
    rollout = play("fallback")
    first_s, cause = recoveries(rollout)[0]
    assert cause == "late chunk" and first_s < kit.EXECUTION.hold_before_recovery_s
    (first,) = [e for e in of_kind(rollout, "discard") if e.payload["arrival"] == 0]
    assert first.t / 1e9 == first_s and first.payload["reason"] == "expired"
    assert rollout.tally.action_ticks == 0 and rollout.tally.fallback_ticks > 0
    assert rollout.outcome is Outcome.INTERVENTION


@pytest.mark.parametrize("what", ["hold", "fallback"])
def test_an_answer_in_time_is_not_touched(play, what):
    """Every chunk begins behind row 0, since to answer takes time; none of them is late."""
    continued, other = play("continue", IN_TIME_S), play(what, IN_TIME_S)
    assert continued.journal.events()[1:] == other.journal.events()[1:]
    assert continued.outcome is Outcome.SUCCESS and set(begins(continued)) == {1}


def test_where_some_answers_are_late_the_others_go_on(play):
    jitter = NetworkJitter(probability=0.5, magnitude_s=0.16)
    rollout = play("hold", IN_TIME_S, schedule=jitter)
    assert rollout.outcome is Outcome.SUCCESS
    lost = rollout.executor.conservation().chunks.discarded
    assert lost["expired"] > 0 and rollout.tally.action_ticks > 0


def test_late_in_contact_alone_ends_with_a_person_and_not_with_waiting(
    make_fixture, kit, plans, tmp_path
):
    """In the open all is well; from the first contact on every answer is late."""
    setup = make_fixture(latency=kit.latency(IN_TIME_S))
    rollout = Rollout(setup, plans.starts[0], 0, calibration_epoch=kit.EPOCH)
    replay = kit.Replay(plans.actions)
    slow = replace(setup, latency=kit.latency(LATE_S))

    def plan(rollout):
        return replay(rollout)

    for _ in range(300):
        if rollout.done:
            break
        contact = rollout.world.phase in setup.task.contact_phases
        rollout.setup = slow if contact else setup
        kit.drive_one(rollout, plan)
    assert rollout.outcome is Outcome.INTERVENTION
    report = kit.check([rollout], tmp_path)
    assert report.violations == []
    phases = {e.payload["phase"] for e in of_kind(rollout, "recovery")}
    assert phases & setup.task.contact_phases
    late = [e for e in of_kind(rollout, "enqueue") if e.payload["checked_rows"][0] > 3]
    assert all(e.payload["phase"] not in setup.task.contact_phases for e in late)
