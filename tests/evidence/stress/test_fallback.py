"""The fallback of a rollout: planned once for each attempt, handed on in chunks, then reached."""

from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.evidence.shadow.rig import Rig
from genpolicy.evidence.stress.fallback import Fallback
from genpolicy.execution.cell import FALLBACK_HASH

PLAN = np.arange(20.0)[:, None] * np.ones((1, 10))


@pytest.fixture
def made():
    """A fallback whose task plans twenty actions; the horizon is eight."""
    asked = []

    def plan(world, kind):
        asked.append(kind)
        return PLAN + 100.0 * (len(asked) - 1)

    recovery = SimpleNamespace(attempts=1, failures=0)
    fixture = SimpleNamespace(
        task=SimpleNamespace(fallback=plan), horizons=SimpleNamespace(prediction_horizon=8)
    )
    world = SimpleNamespace(phase="approach", calibration_epoch="epoch-1")
    rig = Rig()
    rig.observe()
    return SimpleNamespace(
        fallback=Fallback(fixture, world, rig.executor, recovery), asked=asked, recovery=recovery
    )


def test_one_plan_is_handed_on_from_where_it_was_commanded(made):
    first = made.fallback.plan("retreat", ticks=5)
    np.testing.assert_array_equal(first.actions, PLAN[:8])
    np.testing.assert_array_equal(made.fallback.plan("retreat", ticks=11).actions, PLAN[6:14])
    assert made.asked == ["retreat"] and not first.reached


def test_it_is_reached_when_nothing_is_left_of_it(made):
    made.fallback.plan("retreat", ticks=0)
    assert len(made.fallback.plan("retreat", ticks=19).actions) == 1
    last = made.fallback.plan("retreat", ticks=20)
    assert last.reached and len(last.actions) == 0


@pytest.mark.parametrize("change", ["state", "attempts", "failures"])
def test_another_state_or_attempt_plans_anew_from_there(made, change):
    made.fallback.plan("retreat", ticks=0)
    state = "classical_return" if change == "state" else "retreat"
    if change != "state":
        setattr(made.recovery, change, 2)
    again = made.fallback.plan(state, ticks=7)
    np.testing.assert_array_equal(again.actions, PLAN[:8] + 100.0)
    assert made.asked == ["retreat", state]


def test_its_chunks_are_counted_and_carry_the_identity_of_the_fallback(made):
    names = [made.fallback.metadata("s", now).chunk_id for now in (0.0, 0.05)]
    assert names == ["s/fallback/1", "s/fallback/2"]
    found = made.fallback.metadata("s", 0.1)
    assert found.policy_checkpoint_hash == FALLBACK_HASH
    assert (found.task_phase, found.calibration_epoch) == ("approach", "epoch-1")
    assert found.condition_observation_event_time_s == 0.1
