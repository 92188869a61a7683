"""What a perturbation does to the cell itself, once per rollout: pushes, and a recovery drill."""

import numpy as np

from genpolicy.evidence.stress.perturbations import drill_s, pushes
from genpolicy.evidence.stress.state import Setup
from genpolicy.execution.journal import Journal
from genpolicy.tasks.api import World


class Disturbance:
    """Pushes and drill of one rollout, each of which happens once.

    Args:
        setup: What all rollouts share.
        world: What is pushed.
        start: Index of the initial state; key of the draws.
    """

    def __init__(self, setup: Setup, world: World, *, start: int) -> None:
        schedule, seed, name = setup.schedule, setup.root_seed, setup.perturbation
        self._world = world
        self._contact_phases = setup.task.contact_phases
        self._contact_since_s: float | None = None
        self._pushes = list(pushes(schedule, root_seed=seed, name=name, start=start))
        self._drill_s = drill_s(schedule, root_seed=seed, name=name, start=start)

    def push(self, journal: Journal, now_s: float) -> None:
        """Apply the pushes that are due, on record; in contact from where contact began."""
        if self._contact_since_s is None and self._world.phase in self._contact_phases:
            self._contact_since_s = now_s
        for push in list(self._pushes):
            since_s = self._contact_since_s if push.in_contact else 0.0
            if since_s is not None and now_s >= since_s + push.time_s:
                force_n = np.array([0.0, push.force_n, 0.0])
                self._world.apply_force(force_n, push.duration_s)
                self._pushes.remove(push)
                payload = {
                    "force_n": push.force_n, "duration_s": push.duration_s,
                    "in_contact": push.in_contact,
                }  # fmt: skip
                journal.add("push", journal.clock(now_s), payload)

    def drill(self, now_s: float) -> bool:
        """Whether recovery is called for now; true once."""
        due = self._drill_s is not None and now_s >= self._drill_s
        if due:
            self._drill_s = None
        return due
