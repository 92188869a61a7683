"""What a perturbation does to the cell itself: a push in contact touches, a drill is a recovery."""

from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.evidence.stress.disturbance import Disturbance
from genpolicy.evidence.stress.perturbations import RecoveryDrill, SidewaysPush
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.verification.disturbed import Plan, disturbed_otherwise


def causes(rollout):
    return [
        event.payload["cause"]
        for event in rollout.journal.events()
        if event.kind == "recovery" and event.payload["old"] == "idle"
    ]


def test_a_drill_calls_for_recovery_once_though_nothing_is_wrong(run, kit, plans, tmp_path):
    (plain,) = run(kit.Replay(plans.actions))
    (drilled,) = run(kit.Replay(plans.actions), schedule=RecoveryDrill())
    assert causes(plain) == [] and plain.recovery.attempts == 0
    assert causes(drilled)[0] == "drill" and causes(drilled).count("drill") == 1
    assert drilled.tally.fallback_ticks > 0
    assert kit.check([drilled], tmp_path).violations == []


def test_a_push_in_contact_makes_a_clean_insertion_touch(run, kit, plans, tmp_path):
    def pushed(contact_force_n):
        schedule = SidewaysPush(force_n=0.001, contact_force_n=contact_force_n)
        return run(kit.Replay(plans.actions), starts=(0, 1, 2), schedule=schedule)

    clean, hard = pushed(0.0), pushed(40.0)
    for before, after in zip(clean, hard, strict=True):
        assert after.tally.force_peak_n > before.tally.force_peak_n
        assert after.tally.force_peak_n > 0.0
    assert kit.check(hard, tmp_path).violations == []


@pytest.mark.parametrize("schedule", [
    RecoveryDrill(), SidewaysPush(force_n=15.0, contact_force_n=30.0),
])  # fmt: skip
def test_what_happens_to_the_cell_is_on_record_as_the_checker_draws_it(
    run, kit, plans, task, tmp_path, schedule
):
    planned = {"nominal": schedule.model_dump()}
    plan = Plan(planned, frozenset(task.contact_phases), kit.ROOT_SEED)
    rollouts = run(kit.Replay(plans.actions), starts=(0, 1, 2), schedule=schedule)
    write_journal(tmp_path / "journal.mcap", [rollout.journal for rollout in rollouts])
    assert list(disturbed_otherwise(tmp_path / "journal.mcap", plan)) == []
    plain = run(kit.Replay(plans.actions), starts=(0, 1, 2))
    write_journal(tmp_path / "plain.mcap", [rollout.journal for rollout in plain])
    assert len(list(disturbed_otherwise(tmp_path / "plain.mcap", plan))) == 3


class Hand:
    """A world that remembers how it is pushed."""

    def __init__(self):
        self.phase, self.forces = "approach", []

    def apply_force(self, force_n, duration_s):
        self.forces.append((float(force_n[1]), duration_s))


def test_a_push_in_contact_waits_for_contact_and_each_push_happens_once(make_fixture):
    hand, journal = Hand(), Journal("one")
    fixture = make_fixture(
        schedule=SidewaysPush(force_n=15.0, contact_force_n=30.0),
        task=SimpleNamespace(contact_phases=frozenset({"insert"})),
    )
    disturbance = Disturbance(fixture, hand, start=0)
    for now_s in np.arange(0.0, 5.0, 0.05):
        disturbance.push(journal, float(now_s))
    assert [abs(force) for force, _ in hand.forces] == [15.0]
    hand.phase = "insert"
    disturbance.push(journal, 5.0)
    assert len(hand.forces) == 1, "it lowers first"
    for now_s in np.arange(5.0, 9.0, 0.05):
        disturbance.push(journal, float(now_s))
    assert [abs(force) for force, _ in hand.forces] == [15.0, 30.0]
    assert [event.payload["in_contact"] for event in journal.events()] == [False, True]
    assert not disturbance.drill(9.0)
