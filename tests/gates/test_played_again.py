"""What a world does under recorded commands is asked in the order in which the rollout asks."""

from types import SimpleNamespace

import numpy as np
import pytest

from gates import rederive_outcomes as module
from gates.played_again import Played, Recorded, play
from genpolicy.evidence.stress.state import Outcome
from tests.evidence.stress.conftest import EXECUTION


def test_at_the_end_of_the_time_a_stop_is_a_stop():
    """The last period is supervised, so that a time that is over had nothing in it."""
    for how in (Outcome.COLLISION, Outcome.FORCE_STOP, Outcome.SUCCESS):
        last = Played([], (5, how))
        for endless in module.ENDLESS:
            assert not module._agrees(endless, 5, last) and not module._agrees(endless, 6, last)
    assert module._agrees(Outcome.FORCE_STOP, 5, Played([], (5, Outcome.FORCE_STOP)))
    assert module._agrees(Outcome.ASSISTED, 5, Played([], (5, Outcome.SUCCESS)))
    for endless in module.ENDLESS:
        assert module._agrees(endless, 5, Played([], None))


class Inserted:
    """A world that succeeds after three periods, in the last of which it felt and hit something."""

    phase, calibration_epoch, last_action = "insert", "e", np.zeros(10)
    q_meas, tcp_pose = np.zeros(7), (np.zeros(3), np.eye(3))

    def __init__(self, force_n=0.0, *, hits=False):
        self._force_n, self._hits, self.ticks, self.pushed = force_n, hits, 0, []

    success = property(lambda self: self.ticks == 3)
    collision = property(lambda self: self._hits and self.ticks == 3)
    contact_force_n = property(lambda self: self._force_n if self.ticks == 3 else 0.0)

    def observe(self):
        return np.zeros(10)

    def hold(self):
        pass

    def apply_force(self, force_n, duration_s):
        self.pushed.append((self.ticks, force_n[1], duration_s))

    def advance(self):
        self.ticks += 1


def played_in(world, **told):
    recorded = Recorded({}, end_ns=150_000_000, **told)
    task = SimpleNamespace(action_at=lambda seen: np.zeros(10))
    return play(world, recorded, task=task, execution=EXECUTION, period_s=0.05)


@pytest.mark.parametrize(
    ("world", "how"),
    [
        (Inserted(), Outcome.SUCCESS),
        (Inserted(500.0), Outcome.FORCE_STOP),
        (Inserted(hits=True), Outcome.COLLISION),
        (Inserted(500.0, hits=True), Outcome.COLLISION),
    ],
)
def test_a_success_and_a_stop_in_one_tick_are_the_stop(world, how):
    """As the rollout has it, which asks the supervisor before it succeeds."""
    again = played_in(world)
    assert again.ended == (3, how)
    assert [one for one in module.ENDS if module._agrees(one, 3, again)] == (
        [Outcome.SUCCESS, Outcome.ASSISTED] if how is Outcome.SUCCESS else [how]
    )


def test_two_pushes_that_fall_due_together_push_one_after_the_other():
    world = Inserted()
    pushes = [(50_000_000, 15.0, 0.2), (50_000_000, -30.0, 0.1), (100_000_000, 1.0, 0.2)]
    played_in(world, pushes=pushes)
    assert world.pushed == [(1, 15.0, 0.2), (1, -30.0, 0.1), (2, 1.0, 0.2)]
    recorded = Recorded({}, pushes=pushes, end_ns=150_000_000)
    assert recorded.between_ticks(0.05) == []
    recorded.pushes.append((75_000_000, 1.0, 0.2))
    recorded.pushes.append((150_000_000, 1.0, 0.2))
    assert recorded.between_ticks(0.05) == [75_000_000, 150_000_000], "no tick, or none any more"


def test_a_tick_commands_once():
    twice = Recorded({}, commands=[(0, np.zeros(10)), (0, np.ones(10))], end_ns=50_000_000)
    assert twice.between_ticks(0.05) == [0]
