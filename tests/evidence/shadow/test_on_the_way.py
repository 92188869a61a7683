"""What happens while a chunk is on its way: counted by one reason, and nothing of it moves."""

from functools import partial

import pytest

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow import session
from genpolicy.evidence.shadow.on_the_way import INCIDENTS, SUFFIX
from genpolicy.evidence.shadow.session import play, play_incident
from genpolicy.execution.checks import CHECKS, without
from genpolicy.feasibility.figures import expected_motion
from genpolicy.verification.checker import check_messages


@pytest.mark.parametrize("incident", INCIDENTS, ids=lambda incident: incident.name)
def test_each_is_counted_by_its_reason_and_nothing_moves(shadow, demonstrated, incident):
    found = play_incident(shadow.cell, *demonstrated, incident, number=0)
    copies = incident.arrives
    moved = incident.arrives > 1
    assert found.account.generated == copies and found.account.error == 0
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
    sent = {"expired", "broken_predecessor", "out_of_order", "superseded",
            "future_observation", "queue_overflow", "infeasible", "end_of_episode"}  # fmt: skip
    assert {incident.reason for incident in INCIDENTS} == set(DiscardReason) - sent


BLIND = {
    "phase_change_on_the_way": ("phase_transition", "after_phase_transition"),
    "calibration_change_on_the_way": ("calibration_mismatch", "after_calibration_mismatch"),
    "divergence_on_the_way": ("after_observation_divergence",),
    "force_event_on_the_way": ("after_force_event",),
    "collision_event_on_the_way": ("after_collision_event",),
    "cleared_stop_on_the_way": ("after_stop",),
    "handed_back_on_the_way": ("after_intervention",),
    "reset_on_the_way": ("session_epoch", "after_reset"),
    "other_weights_on_the_way": ("checkpoint_mismatch",),
    "other_sampler_on_the_way": ("sampler_mismatch",),
    "delay_on_the_way": ("stale_observation",),
    "copy_on_the_way": ("duplicate",),
}


@pytest.mark.parametrize("name", BLIND)
def test_an_executor_that_does_not_look_is_seen(shadow, demonstrated, name, monkeypatch):
    """The stub, which looks for itself, refuses what arrives there; but it arrives."""
    (incident,) = (item for item in INCIDENTS if item.name == name)
    blind = partial(session.Executor, checks=without(CHECKS, *BLIND[name]))
    monkeypatch.setattr(session, "Executor", blind)
    found = play_incident(shadow.cell, *demonstrated, incident, number=0)
    once = incident.arrives > 1
    assert found.account.discarded != {incident.reason: 1} or (found.arrivals and not once)
    assert found.account.executed == once
