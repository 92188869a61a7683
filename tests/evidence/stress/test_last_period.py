"""The last period of a rollout has a supervisor too: what it felt there is no success."""

import math

import pytest

from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.state import Outcome
from genpolicy.execution.supervisor import Supervisor

TOO_MUCH_N = 500.0


@pytest.fixture
def feels(monkeypatch, plans, kit, make_fixture):
    """A rollout whose world says something else from some moment on, to its end."""

    def go(name, value, when, *, ticks=300):
        rollout = Rollout(make_fixture(), plans.starts[0], 0, calibration_epoch=kit.EPOCH)
        kind = type(rollout.world)
        honest = getattr(kind, name)
        told = property(lambda world: value if when(rollout) else honest.fget(world))
        monkeypatch.setattr(kind, name, told)
        kit.drive([rollout], kit.Replay(plans.actions), ticks=ticks)
        return rollout

    return go


def _succeeds(rollout):
    return rollout.world.success


@pytest.mark.parametrize(("name", "value", "outcome"), [
    ("contact_force_n", TOO_MUCH_N, Outcome.FORCE_STOP), ("collision", True, Outcome.COLLISION),
    ("contact_force_n", float("nan"), Outcome.FORCE_STOP),
    ("contact_force_n", 0.0, Outcome.SUCCESS), ("collision", False, Outcome.SUCCESS),
])  # fmt: skip
def test_what_ends_in_a_stop_is_no_success(feels, kit, tmp_path, name, value, outcome):
    rollout = feels(name, value, _succeeds)
    assert rollout.world.success and rollout.outcome is outcome
    stops = [e.payload["event"] for e in rollout.journal.events() if e.kind == "supervisor"]
    assert stops == {Outcome.FORCE_STOP: ["force"], Outcome.COLLISION: ["collision"]}.get(
        outcome, []
    )
    assert rollout.supervisor.state.value == ("protective_stop" if stops else "run")
    if not math.isnan(value):  # no journal can be read that holds such a state
        assert kit.check([rollout], tmp_path).violations == []


def test_nor_is_a_timeout(feels, kit, tmp_path):
    rollout = feels("contact_force_n", TOO_MUCH_N, lambda it: it.tick == 20, ticks=20)
    assert rollout.tick == 20 and rollout.outcome is Outcome.FORCE_STOP
    assert kit.check([rollout], tmp_path).violations == []


def test_a_success_that_a_deaf_supervisor_let_end_is_found(feels, kit, tmp_path, monkeypatch):
    monkeypatch.setattr(Supervisor, "observe_force", lambda *_: False)
    rollout = feels("contact_force_n", TOO_MUCH_N, _succeeds)
    assert rollout.outcome is Outcome.SUCCESS
    assert {each.rule for each in kit.check([rollout], tmp_path).violations} == {"P7.force"}
