"""What happens while a chunk is on its way: counted by one reason, and nothing of it moves."""

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest

from gates.asked_for import OF_TWO
from gates.feasibility.incidents import _counted
from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow import session
from genpolicy.evidence.shadow.case import newer_than
from genpolicy.evidence.shadow.on_the_way import INCIDENTS, SUFFIX
from genpolicy.evidence.shadow.session import play, play_incident
from genpolicy.evidence.shadow.shadow import admit, case_of
from genpolicy.evidence.shadow.stop_mutants import DEAF
from genpolicy.execution.cell import Cell
from genpolicy.execution.checks import CHECKS, without
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal
from genpolicy.feasibility.admission import Admitted
from genpolicy.feasibility.figures import expected_motion
from genpolicy.verification.checker import check_messages


def injected(shadow, demonstrated, incident):
    """The session of the demonstrated chunk in which something happens."""
    newer = newer_than(shadow.checker, demonstrated[1]) if incident.overtaken else None
    return play_incident(shadow.cell, *demonstrated, incident, number=0, newer=newer)


def of_two(incident):
    """Two chunks are counted, of which one is executed."""
    return incident.arrives > 1 or incident.overtaken or incident.hangs


def named(name):
    (incident,) = (item for item in INCIDENTS if item.name == f"{name}{SUFFIX}")
    return incident


def of_kind(found, kind):
    return [event.payload for event in found.journal.events() if event.kind == kind]


@pytest.mark.parametrize("incident", INCIDENTS, ids=lambda incident: incident.name)
def test_each_is_counted_by_its_reason_and_nothing_moves(shadow, demonstrated, incident):
    found = injected(shadow, demonstrated, incident)
    moved = of_two(incident)
    assert found.account.generated == 1 + moved and found.account.error == 0
    assert found.account.executed == moved and (found.arrivals > 0) == moved
    assert found.account.discarded == {incident.reason: 1}
    assert (found.stale, found.invalid) == (0, 0)
    told = (
        (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload})
        for e in found.journal.events()
    )
    report = check_messages(told, None, expected_motion(shadow.checker.cell))
    assert report.violations == []


def test_without_an_incident_the_same_chunk_is_executed(shadow, demonstrated):
    """Else the incidents would show nothing."""
    item, case, result = demonstrated
    found = play(shadow.cell, item, [(case, result)], fixture="held_out", number=0)
    assert found.account.executed == 1 and found.arrivals > 0 and found.account.discarded == {}


def test_names_are_unique_and_recognised():
    names = [incident.name for incident in INCIDENTS]
    assert len(set(names)) == len(names) and all(name.endswith(SUFFIX) for name in names)
    # Every reason that can befall a chunk that was admitted, but those that its sender makes.
    sent = {"broken_predecessor", "superseded", "future_observation", "queue_overflow",
            "infeasible"}  # fmt: skip
    assert {incident.reason for incident in INCIDENTS} == set(DiscardReason) - sent


BLIND = {
    "phase_change_on_the_way": ("phase_transition", "after_phase_transition"),
    "calibration_change_on_the_way": ("calibration_mismatch", "after_calibration_mismatch"),
    "divergence_on_the_way": ("after_observation_divergence",),
    "moved_body_on_the_way": ("scene",),
    "force_event_on_the_way": ("after_force_event",),
    "collision_event_on_the_way": ("after_collision_event",),
    "cleared_stop_on_the_way": ("after_stop",),
    "handed_back_on_the_way": ("after_intervention",),
    "reset_on_the_way": ("session_epoch", "after_reset"),
    "other_weights_on_the_way": ("checkpoint_mismatch",),
    "other_sampler_on_the_way": ("sampler_mismatch",),
    "delay_on_the_way": ("stale_observation",),
    "copy_on_the_way": ("duplicate",),
    "overtaken_on_the_way": ("behind_queued",),
}


@pytest.mark.parametrize("name", BLIND)
def test_an_executor_that_does_not_look_is_seen(shadow, demonstrated, name, monkeypatch):
    """The stub, which looks for itself, refuses what arrives there; but it arrives."""
    (incident,) = (item for item in INCIDENTS if item.name == name)
    blind = partial(session.Executor, checks=without(CHECKS, *BLIND[name]))
    monkeypatch.setattr(session, "Executor", blind)
    found = injected(shadow, demonstrated, incident)
    once = of_two(incident)
    assert found.account.discarded != {incident.reason: 1} or (found.arrivals and not once)
    assert found.account.executed == (name == "copy_on_the_way")


STOPS = ("force", "collision", "emergency_stop")  # what an incident tells a supervisor


@pytest.mark.parametrize("name", STOPS)
def test_a_supervisor_that_is_deaf_to_what_stops_is_seen(shadow, demonstrated, name, monkeypatch):
    monkeypatch.setattr(session, "Supervisor", DEAF[name][0])
    for other in STOPS:
        incident = named(other if other == "emergency_stop" else f"{other}_stop")
        found = injected(shadow, demonstrated, incident)
        assert (found.account.executed > 0) == (other == name)
        assert (found.account.discarded == {incident.reason: 1}) == (other != name)


@pytest.mark.parametrize(("name", "why"), [
    ("clock_forward", "clock_ahead"), ("clock_backward", "clock_backwards"),
])  # fmt: skip
def test_on_a_clock_that_steps_every_tick_holds_and_says_why(shadow, demonstrated, name, why):
    found = injected(shadow, demonstrated, named(name))
    ticks = shadow.cell.horizons.execution_horizon + 1
    assert [payload["reason"] for payload in of_kind(found, "hold")] == [why] * ticks
    assert found.journal.doubts >= ticks and found.journal.doubt == why
    times = [event.t for event in found.journal.events()]
    assert times == sorted(times) and times[-1] < 10**9  # the last time that was believed


def test_a_policy_that_hangs_is_given_up_and_the_arm_holds(shadow, demonstrated):
    found = injected(shadow, demonstrated, named("policy_hang"))
    told = [(p["stage"], p["detail"]) for p in of_kind(found, "invocation")]
    assert told == [("begin", ""), ("end", "answered"), ("begin", ""), ("end", "deadline")]
    assert [p["event"] for p in of_kind(found, "supervisor")] == ["watchdog"]
    accepted = of_kind(found, "accept")
    # Every tick of the session is an action or a hold: nothing is made up, and nothing waits.
    holds = [p["reason"] for p in of_kind(found, "hold")]
    cell = shadow.cell
    waited = round(cell.execution.deadline_s / cell.horizons.action_period_s) + 1
    ticks = cell.horizons.execution_horizon + 1 + waited
    assert len(accepted) + holds.count("empty") == ticks
    assert {p["chunk_id"] for p in accepted} == {demonstrated[1].proposal.metadata.chunk_id}


@pytest.mark.parametrize("deadline_s", [0.01, 0.5, 2.0])
def test_a_policy_that_hangs_is_given_up_however_long_that_takes(shadow, demonstrated, deadline_s):
    execution = shadow.cell.execution.model_copy(update={"deadline_s": deadline_s})
    patient = replace(shadow, cell=Cell(shadow.cell.horizons, execution))
    assert wrongs(injected(patient, demonstrated, named("policy_hang")), named("policy_hang")) == 0


def test_of_two_in_the_wrong_order_the_newer_one_moves(shadow, demonstrated):
    found = injected(shadow, demonstrated, named("overtaken"))
    (moved,) = {p["chunk_id"] for p in of_kind(found, "accept")}
    assert moved == f"{demonstrated[1].proposal.metadata.chunk_id}/later"


def test_a_supervisor_that_starts_again_is_on_record(shadow, demonstrated):
    found = injected(shadow, demonstrated, named("supervisor_restart"))
    assert [p["event"] for p in of_kind(found, "supervisor")] == ["restarted"]
    assert {p["reason"] for p in of_kind(found, "hold")} == {"stopped"}


def test_in_every_phase_each_new_one_is_counted(shadow, observations):
    tried = set()
    for number, item in enumerate(observations):
        case = case_of(shadow, item, item.demonstrated, number=number)
        result = admit(shadow, case)
        if not isinstance(result, Admitted) or item.phase in tried:
            continue
        tried.add(item.phase)
        for incident in INCIDENTS[-5:]:
            assert wrongs(injected(shadow, (item, case, result), incident), incident) == 0
    assert tried & shadow.task.contact_phases and tried & shadow.task.free_phases


def no_doubt(patch):
    patch.setattr(Journal, "_doubt", lambda self, now_ns: "")


def no_hold_in_doubt(patch):
    honest = Executor.tick

    def tick(self, now_s):
        self._journal.clock(now_s)
        return honest(self, self._journal.latest_ns / 1e9)

    patch.setattr(Executor, "tick", tick)


def never_given_up(patch):
    patch.setattr(Executor, "end_invocation", lambda self, now_s, invocation_id, detail="": None)


def never_asked(patch):
    patch.setattr(Executor, "needs_invocation", lambda self, now_s: False)


def no_memory(patch):
    """A new supervisor takes the session for its own first one."""
    patch.setattr(Journal, "__len__", lambda self: 0)


def newest_last(patch):
    """Whatever comes last counts, as in a queue that looks at no observation."""
    patch.setattr(session, "Executor", partial(Executor, checks=without(CHECKS, "behind_queued")))


@pytest.mark.parametrize(("name", "wrong"), [
    ("clock_forward", no_doubt), ("clock_forward", no_hold_in_doubt),
    ("clock_backward", no_doubt), ("clock_backward", no_hold_in_doubt),
    ("policy_hang", never_given_up), ("policy_hang", never_asked),
    ("supervisor_restart", no_memory), ("overtaken", newest_last),
])  # fmt: skip
def test_each_can_turn_gate_c_red(shadow, demonstrated, name, wrong, monkeypatch):
    """What the gate asks of the balance and of the stub, of one session."""
    incident = named(name)
    assert wrongs(injected(shadow, demonstrated, incident), incident) == 0
    wrong(monkeypatch)
    assert wrongs(injected(shadow, demonstrated, incident), incident) > 0


def wrongs(found, incident):
    """The gate's own sum over the tables of one session."""
    account = found.account
    totals, reason = (account.generated, account.executed), str(incident.reason)
    discarded = account.discarded or {"": 0}
    stated = np.array([(*totals, count) for count in discarded.values()], dtype=np.float64)
    hit = np.array([str(said) == reason for said in discarded])
    stub = {"arrivals": found.arrivals, "stale": found.stale, "invalid": found.invalid}
    counted = _counted(incident.name, reason, stated, hit, pd.DataFrame([stub]))
    assert (incident.name in OF_TWO) == of_two(incident)
    return counted.wrong
