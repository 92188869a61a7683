"""The measured state of a rollout: once a tick, to its end, and what a journal without it shows."""

import numpy as np
import pytest

from genpolicy.contract.latency import Term
from genpolicy.evidence.stress.measured import Measured, rounded
from genpolicy.execution.journal import Journal

PERIOD_NS = 50_000_000
BYTES_A_TICK = 420
"""What a state may take as it is written, before it is packed."""


@pytest.fixture(scope="module")
def rollout(run, plans, kit):
    (done,) = run(kit.Replay(plans.actions))
    return done


def of_kind(rollout, kind):
    return [event for event in rollout.journal.events() if event.kind == kind]


def told_otherwise(rollout, change):
    """The rollout's journal with each event as `change` has it; None leaves one out."""
    journal = Journal(rollout.journal.session, rollout.journal.labels)
    for event in rollout.journal.events():
        payload = change(event.kind, event.payload)
        if payload is not None:
            journal.add(event.kind, event.t, payload)
    return journal


def test_every_tick_has_its_state_and_so_has_the_end(rollout, kit, tmp_path):
    states = of_kind(rollout, "state")
    assert [event.t for event in states] == [n * PERIOD_NS for n in range(rollout.tick + 1)]
    assert states[-1].t == of_kind(rollout, "end")[0].t
    world, last = rollout.world, states[-1].payload
    np.testing.assert_allclose(last["q_rad"], world.q_meas, atol=5e-7)
    np.testing.assert_allclose(last["tcp_m"], world.tcp_pose[0], atol=5e-7)
    assert last["gripper_m"] == pytest.approx(world.gripper_opening_m, abs=5e-7)
    assert last["gripper_m"] > states[0].payload["gripper_m"]  # it let go
    assert kit.check([rollout], tmp_path).violations == []


def test_the_terms_of_each_invocation_sum_to_its_latency(rollout):
    begun = [e.payload for e in of_kind(rollout, "invocation") if e.payload["stage"] == "begin"]
    stated = [event.payload for event in of_kind(rollout, "latency")]
    assert [m["id"] for m in stated] == [m["id"] for m in begun] != []
    for own, whole in zip(stated, begun, strict=True):
        assert sum(own[f"{term}_s"] for term in Term) == pytest.approx(float(whole["detail"]))


FAULTS = {
    "no state": (lambda kind, p: None if kind == "state" else p, "state.missing"),
    "a joint": (
        lambda kind, p: p | {"q_rad": [0.0, *p["q_rad"][1:]]} if kind == "state" else p,
        "state.pose",
    ),
    "a force": (lambda kind, p: p | {"force_n": 9.0} if kind == "state" else p, "state.force"),
    "a term": (
        lambda kind, p: p | {"sample_s": p["sample_s"] + 1e-6} if kind == "latency" else p,
        "clock.terms",
    ),
    "no terms": (lambda kind, p: None if kind == "latency" else p, "clock.terms"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_journal_that_tells_otherwise_is_found(rollout, kit, tmp_path, fault, monkeypatch):
    change, rule = FAULTS[fault]
    monkeypatch.setattr(rollout, "journal", told_otherwise(rollout, change))
    assert rule in {violation.rule for violation in kit.check([rollout], tmp_path).violations}


def test_one_rollout_without_states_is_found_among_others(run, plans, kit, tmp_path, monkeypatch):
    one, other = run(kit.Replay(plans.actions), starts=(0, 1), ticks=8)
    bare = told_otherwise(other, lambda kind, p: None if kind == "state" else p)
    monkeypatch.setattr(other, "journal", bare)
    found = kit.check([one, other], tmp_path).violations
    assert {(v.session, v.rule) for v in found if v.rule == "state.missing"} == {
        (other.journal.session, "state.missing")
    }


def test_a_state_is_small(rollout):
    """The bound that the docs state: each tick at most so much, whatever happens."""
    longest = {"q_rad": [-2.123456] * 7, "tcp_m": [-0.123456] * 3, "tcp_rotation": [-0.123456] * 6,
               "gripper_m": 0.123456, "force_n": 123456.123456}  # fmt: skip
    name = f'{{"session":"{"x" * 60}","n":99999,"t":{10**11},'
    assert len(name) + len(str(longest)) < BYTES_A_TICK
    assert {*longest} == {*of_kind(rollout, "state")[0].payload}


def test_a_time_is_stated_once(rollout):
    journal = Journal("s")
    measured = Measured(rollout.setup.task, rollout.world, journal)
    measured.note(0.0)
    measured.note(0.0)
    assert len(journal) == 1
    assert measured.q_before_rad is None
    measured.note(0.05)
    assert len(journal) == 2
    assert measured.q_before_rad is not None


def test_six_decimals_and_no_negative_zero():
    """By hand."""
    assert rounded(np.array([[0.1234567, -1e-9], [1.0, -2.5]])) == [0.123457, 0.0, 1.0, -2.5]
    assert str(rounded(np.array([-0.0]))[0]) == "0.0"


def test_a_force_that_is_there_at_the_start_is_its_first_peak(run, plans, kit, monkeypatch):
    world = type(run(kit.Replay(plans.actions), ticks=1)[0].world)
    monkeypatch.setattr(world, "contact_force_n", property(lambda self: 2.0))
    (rollout,) = run(kit.Replay(plans.actions), ticks=3)
    assert [event.payload for event in of_kind(rollout, "force")] == [{"force_n": 2.0}]
    kinds = [event.kind for event in rollout.journal.events()]
    assert kinds.index("force") < kinds.index("state")
