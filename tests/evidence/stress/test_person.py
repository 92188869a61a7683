"""A person is called, comes, drives through the same checks, hands back; what counts after it."""

from dataclasses import asdict, replace
from types import SimpleNamespace

import pytest
from pydantic import ValidationError

from genpolicy.evidence.stress.person import WHO, Attendance, person_s
from genpolicy.evidence.stress.perturbations import CameraDelay
from genpolicy.evidence.stress.recoveries import recovery_rows
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.settings import PersonSettings
from genpolicy.evidence.stress.state import Outcome
from genpolicy.execution.cell import ExecutionSettings, RecoveryState
from genpolicy.seeds import stream
from genpolicy.verification.rollouts import derived_with_recoveries

PERSON = PersonSettings(reaction_s=[0.4, 0.8], longest_s=20.0)


def of_kind(rollout, kind):
    return [event for event in rollout.journal.events() if event.kind == kind]


def states(rollout):
    return [(e.t / 1e9, e.payload["new"]) for e in of_kind(rollout, "recovery")]


@pytest.fixture(scope="module")
def patient(kit):
    """Nothing but a person recovers, and a person is waited for."""
    changes = {"recovery_plans": {"default": []}, "human_timeout_s": 2.0}
    return ExecutionSettings(**kit.PARAMS["execution"] | {"term_deadlines": []} | changes)


@pytest.fixture
def play(make_fixture, kit, plans, patient, tmp_path):
    """A rollout whose first answers are too late, proved by the checker."""

    def go(person=PERSON, slow_ticks=30, **changes):
        setup = make_fixture(execution=patient, person=person, **changes)
        slow = replace(setup, latency=kit.latency(0.5))
        rollout = Rollout(slow, plans.starts[0], 0, calibration_epoch=kit.EPOCH)
        replay = kit.Replay(plans.actions)
        for tick in range(400):
            if rollout.done:
                break
            if tick == slow_ticks:
                rollout.setup = setup
                rollout._deliveries._setup = setup
            kit.drive_one(rollout, replay)
        rollout.end(Outcome.TIMEOUT)
        report = kit.check([rollout], tmp_path, execution=patient)
        assert report.violations == [] and rollout.executor.conservation().error == 0
        assert rollout.stub.stale == rollout.stub.invalid == 0
        shard = SimpleNamespace(
            judged=SimpleNamespace(name=setup.method, seed=0), perturbation="nominal"
        )
        rows = recovery_rows(shard, rollout)
        derived, entries = derived_with_recoveries(tmp_path / "journal.mcap")
        assert [asdict(row) for row in rows] == [{**row, "seed": 0} for row in entries]
        (columns,) = derived.values()
        assert columns["interventions"] == rollout.person.calls
        assert columns["person_s"] == person_s(rollout.journal.events())
        assert columns["success"] is (rollout.outcome is Outcome.SUCCESS)
        return rollout

    return go


@pytest.fixture
def helped(play):
    return play()


def test_the_arm_holds_until_the_person_comes_and_only_the_person_drives(helped, kit):
    """Called, 0.4 to 0.8 s later there, away from what stopped the policy, and handed back."""
    told = [(e.payload["stage"], e.payload["who"]) for e in of_kind(helped, "person")]
    assert told == [("took_over", WHO), ("handed_back", WHO)]
    came, went = (e.n for e in of_kind(helped, "person"))
    (called_s,) = [t for t, state in states(helped) if state == RecoveryState.ASK_HUMAN]
    (came_s,) = [t for t, state in states(helped) if state == RecoveryState.PERSON]
    drawn_s = stream(kit.ROOT_SEED, "person", "nominal", 0, 0).uniform(0.4, 0.8)
    assert 0.0 <= came_s - called_s - drawn_s < kit.HORIZONS.action_period_s
    driven = of_kind(helped, "fallback")
    assert driven and all(came < event.n < went for event in driven)
    by = {e.payload["chunk_id"]: e.payload["method"] for e in of_kind(helped, "enqueue")}
    assert {by[event.payload["chunk_id"]] for event in driven} == {WHO}
    assert not any(came < event.n < went for event in of_kind(helped, "accept"))


def test_after_it_the_policy_goes_on_and_its_success_is_not_one(helped):
    _, went = (e.n for e in of_kind(helped, "person"))
    assert any(event.n > went for event in of_kind(helped, "accept"))
    assert helped.world.success and helped.outcome is Outcome.ASSISTED
    assert helped.person.calls == 1 and person_s(helped.journal.events()) > 0.5


def test_the_next_arrival_after_a_hand_back_may_be_older_and_costs_an_invocation(play):
    """Decision 232: a late camera shows what was before, which is void; nothing of it is used."""
    rollout = play(schedule=CameraDelay(magnitude_s=0.08))
    went = next(e for e in of_kind(rollout, "person") if e.payload["stage"] == "handed_back")
    void = next(e for e in of_kind(rollout, "invalidate") if e.n > went.n)
    begun = [e.payload for e in of_kind(rollout, "conditioning") if e.n > went.n]
    assert begun[0]["exposed_ns"] < void.payload["before_ns"]
    used = {e.payload["chunk_id"] for e in of_kind(rollout, "accept")}
    names = {one["id"] for one in begun if one["exposed_ns"] < void.payload["before_ns"]}
    assert not used & names
    assert any(e.n > went.n for e in of_kind(rollout, "accept"))


def test_without_a_person_the_call_ends_the_rollout_as_ever(play):
    rollout = play(person=None)
    assert rollout.outcome is Outcome.INTERVENTION and rollout.person.calls == 1
    assert not of_kind(rollout, "person") and not of_kind(rollout, "fallback")
    assert person_s(rollout.journal.events()) == 0.0


def test_one_who_comes_too_late_finds_it_aborted(play):
    rollout = play(person=PersonSettings(reaction_s=[3.0, 3.0], longest_s=20.0))
    assert rollout.outcome is Outcome.INTERVENTION and rollout.person.calls == 1
    assert states(rollout)[-1][1] == RecoveryState.ABORT and not of_kind(rollout, "person")


def test_success_while_the_person_is_still_on_the_way_is_not_the_policy_s(play, monkeypatch):
    """Whoever was called had to be: what succeeds by itself meanwhile is assisted at best."""
    call = Attendance.attend

    def there(attendance, *given):
        goes_on = call(attendance, *given)
        monkeypatch.setattr(type(attendance._world), "success", True)
        return goes_on

    monkeypatch.setattr(Attendance, "attend", there)
    rollout = play()
    assert not of_kind(rollout, "person") and rollout.outcome is Outcome.ASSISTED


def test_one_who_does_not_get_there_in_time_gives_up(play):
    rollout = play(person=PersonSettings(reaction_s=[0.0, 0.0], longest_s=0.3))
    assert rollout.outcome is Outcome.INTERVENTION
    assert [e.payload["stage"] for e in of_kind(rollout, "person")] == ["took_over", "gave_up"]
    assert person_s(rollout.journal.events()) == pytest.approx(0.35, abs=0.051)


def test_a_stop_while_the_person_drives_stays(play, monkeypatch):
    """The supervisor stops for whoever drives; nobody here clears it, and the rollout is over."""
    sense = Rollout.sense

    def pushed(rollout):
        if rollout.executor.person:
            rollout.supervisor.observe_force(rollout.now_s, 1e3, rollout.world.phase)
        sense(rollout)

    monkeypatch.setattr(Rollout, "sense", pushed)
    rollout = play()
    assert rollout.supervisor.stopped and rollout.outcome is not Outcome.SUCCESS
    assert not [e for e in of_kind(rollout, "supervisor") if e.payload["event"] == "human_reset"]
    stopped = next(e.n for e in of_kind(rollout, "supervisor") if "stop" in e.payload["state"])
    assert not [e for e in of_kind(rollout, "fallback") if e.n > stopped]


def test_the_same_person_comes_to_every_method(play):
    one, other = (play(method=name) for name in ("scripted", "another"))
    assert states(one) == states(other)


@pytest.mark.parametrize(
    "given",
    [{"reaction_s": [1.0, 0.5], "longest_s": 1.0}, {"reaction_s": [-1.0, 0.5], "longest_s": 1.0},
     {"reaction_s": [0.5, 1.0], "longest_s": 0.0}],
)  # fmt: skip
def test_a_person_who_cannot_be_is_refused(given):
    with pytest.raises(ValidationError):
        PersonSettings(**given)
