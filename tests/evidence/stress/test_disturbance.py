"""What a perturbation does to the cell itself: a push in contact touches, a drill is a recovery."""

from types import SimpleNamespace

import numpy as np

from genpolicy.evidence.stress.disturbance import Disturbance
from genpolicy.evidence.stress.perturbations import RecoveryDrill, SidewaysPush


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


class Hand:
    """A world that remembers how it is pushed."""

    def __init__(self):
        self.phase, self.forces = "approach", []

    def apply_force(self, force_n, duration_s):
        self.forces.append((float(force_n[1]), duration_s))


def test_a_push_in_contact_waits_for_contact_and_each_push_happens_once(make_fixture):
    hand = Hand()
    fixture = make_fixture(
        schedule=SidewaysPush(force_n=15.0, contact_force_n=30.0),
        task=SimpleNamespace(contact_phases=frozenset({"insert"})),
    )
    disturbance = Disturbance(fixture, hand, start=0)
    for now_s in np.arange(0.0, 5.0, 0.05):
        disturbance.push(float(now_s))
    assert [abs(force) for force, _ in hand.forces] == [15.0]
    hand.phase = "insert"
    disturbance.push(5.0)
    assert len(hand.forces) == 1, "it lowers first"
    for now_s in np.arange(5.0, 9.0, 0.05):
        disturbance.push(float(now_s))
    assert [abs(force) for force, _ in hand.forces] == [15.0, 30.0]
    assert not disturbance.drill(9.0)
