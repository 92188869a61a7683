"""A task that does not do the same again is refused before anything is recorded."""

from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.data.recording.episode import ACTION_STREAM
from genpolicy.errors import BadInputError
from genpolicy.tasks.api import load_task
from genpolicy.tasks.same_again import require_same_again


def asked(task, *, demonstrates=True):
    require_same_again(task, period_s=0.05, demonstrates=demonstrates)


@pytest.mark.parametrize("demonstrates", [True, False])
@pytest.mark.parametrize("name", ["tabletop_insertion", "ring_cell"])
def test_tasks_that_do_the_same_again_pass(foreign_task, name, demonstrates):
    asked(load_task(name), demonstrates=demonstrates)


class Slide:
    """A world that goes where it is told; what it may share or draw is its task's."""

    phase, calibration_epoch, collision, contact_force_n = "go", "e", False, 0.0

    def __init__(self, task, start):
        self.task, self.q_meas, self.last_action = task, np.full(1, start), np.zeros(10)
        self.at_m, self.target_m, self.ticks = start, start, 0
        task.begins(self)

    tcp_pose = property(lambda self: (np.array([self.at_m, 0.0, 0.0]), np.eye(3)))
    success = property(lambda self: self.task.succeeds(self))

    def state_sha256(self):
        return f"{self.at_m!r}"

    def observe(self):
        return np.full(10, self.at_m) + self.task.noise()

    def command(self, action):
        self.target_m = float(action[0])

    def hold(self):
        pass

    def apply_force(self, force_n, duration_s):
        self.task.pushed_n = float(force_n[1])

    def advance(self):
        self.ticks += 1
        self.at_m = self.task.goes(self)


class Sliding:
    """An honest task; its heirs are not."""

    name, phases, calibration_epochs = "sliding", ("go",), ("e",)
    last, pushed_n, made = 0.0, 0.0, 0

    def sample_start(self, rng):
        value = float(rng.uniform())
        return SimpleNamespace(value=value, to_json=lambda: repr(value))

    def make_world(self, start, *, settings):
        return Slide(self, start.value)

    def episode_specs(self, root_seed, episodes):
        return [SimpleNamespace(start=self.sample_start(np.random.default_rng(root_seed)))]

    def record_episode(self, spec):
        path = np.linspace(spec.start.value, spec.start.value + 0.4, 40)
        actions = np.stack([path] * 10, axis=1)
        return SimpleNamespace(streams={ACTION_STREAM: SimpleNamespace(values=actions)})

    def fallback(self, world, kind):
        return np.full((30, 10), world.at_m + 0.1)

    def action_at(self, observation):
        return np.zeros(10)

    def begins(self, world):
        pass

    def noise(self):
        return 0.0

    def goes(self, world):
        return 0.5 * (world.at_m + world.target_m)

    def succeeds(self, world):
        return world.ticks == 38


class DrawsItsStart(Sliding):
    def begins(self, world):
        world.at_m += 1e-9 * np.random.default_rng().uniform()


class DrawsAnyStart(Sliding):
    def sample_start(self, rng):
        return super().sample_start(np.random.default_rng())


class NoisyAtRest(Sliding):
    def noise(self):
        return np.random.default_rng().normal()


class NoisyOnItsWay(Sliding):
    def goes(self, world):
        return super().goes(world) + 1e-3 * np.random.default_rng().uniform()


class NoisyAtTheEnd(Sliding):
    def goes(self, world):
        return super().goes(world) + 1e-3 * np.random.default_rng().uniform() * (world.ticks > 30)


class EndsByChance(Sliding):
    def __init__(self):
        self.worlds = 0

    def begins(self, world):
        self.worlds += 1
        world.number = self.worlds

    def succeeds(self, world):
        return world.ticks == 39 - (world.number > 4)


class GoesOnFromTheLast(Sliding):
    """One target for all worlds, which a new one does not put back."""

    def goes(self, world):
        self.last = 0.9 * self.last + 0.1 * world.target_m
        return self.last


class OneStateForAll(Sliding):
    """Each new world puts it back: what was played one behind the other is the same."""

    def begins(self, world):
        self.last = world.at_m

    def goes(self, world):
        self.last = 0.9 * self.last + 0.1 * world.target_m
        return self.last


class KeepsThePush(Sliding):
    """It shows late: a whole play of a fresh world has to ask for it."""

    def goes(self, world):
        return super().goes(world) + 1e-3 * self.pushed_n * (world.ticks > 30)


def test_an_honest_one_passes():
    asked(Sliding())
    asked(Sliding(), demonstrates=False)


@pytest.mark.parametrize(("task", "said"), [
    (DrawsItsStart, "commands a second time is at rest in the state"),
    (DrawsAnyStart, "sample_start, twice with the same generator is 0"),
    (NoisyAtRest, "a second time is observed at rest up to"),
    (NoisyOnItsWay, r"a second time is at 0\.050 s: tcp_m up to"),
    (NoisyAtTheEnd, r"in a fresh world behind another start is at 1\.5.* s: tcp_m up to"),
    (EndsByChance, "is at 1.900 s: go, success, expected go. Draw"),
    (GoesOnFromTheLast, r"a second time is at 0\.050 s: tcp_m up to"),
    (OneStateForAll, r"in a world that was made before another start was played is at"),
    (KeepsThePush, r"in a fresh world behind another start is at 1\.5.* s: tcp_m up to"),
])  # fmt: skip
def test_a_task_that_does_not_is_refused_by_what_differs(task, said):
    with pytest.raises(BadInputError, match=said) as caught:
        asked(task())
    assert caught.value.exit_code == 2 and "from" in caught.value.action


def test_what_rounds_otherwise_is_the_same():
    class Rounds(Sliding):
        def goes(self, world):
            return super().goes(world) + 1e-9 * np.random.default_rng().uniform()

    asked(Rounds())
