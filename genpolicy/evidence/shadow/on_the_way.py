"""What can happen while a chunk is on its way from its observation to the executor.

The chunk itself is good, and was admitted. Each incident has one reason by which the executor must
count it, and none of its actions may reach the controller stub. Where two chunks are counted (a
copy, an older one behind a newer one, one that never comes behind one that came) one of them is
executed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow.observations import Observation
from genpolicy.execution.executor import Executor
from genpolicy.execution.informed import UNKNOWN
from genpolicy.execution.journal import Journal
from genpolicy.execution.supervisor import Supervisor

Array = NDArray[np.float64]

SUFFIX = "_on_the_way"
"""Ends the names of the fixtures; their chunks are those of `held_out`."""
OTHER = "0" * 64  # a hash of nothing
CLOCK_STEP_S = 3600.0  # a daylight saving hour; far beyond what a clock may leap


ASIDE_M = 0.02
"""Beyond what a body may have moved, whatever that is."""


@dataclass(frozen=True)
class Way:
    """A session in which the chunk has not arrived yet.

    Attributes:
        executor: Its executor.
        supervisor: Its supervisor.
        journal: Its journal.
        item: The observation that the chunk was made from.
        poses: Where bodies were seen in it.
        checkpoint: Weights in force.
        sampler: Sampler settings in force.
        now_s: When the chunk arrives, s.
    """

    executor: Executor
    supervisor: Supervisor
    journal: Journal
    item: Observation
    poses: Mapping[str, tuple[Array, Array]]
    checkpoint: str
    sampler: str
    now_s: float

    def look(self, **changes: object) -> None:
        """An observation now, with something else than the one before."""
        told = {"phase": self.item.phase, "calibration_epoch": self.item.calibration_epoch}
        self.executor.observe(self.now_s, self.now_s, **(told | changes))  # type: ignore[arg-type]


@dataclass(frozen=True)
class Incident:
    """Something that happens while a chunk is on its way.

    Attributes:
        name: Name of the fixture.
        reason: By which the executor must count the chunk.
        happen: What happens before it arrives.
        late: It arrives when its validity has ended and its observation is too old.
        arrives: How often it does.
        clock_s: What the clock of everybody is wrong by from its arrival on.
        overtaken: A chunk of a newer observation arrives before it, and is executed.
        hangs: It is executed, and when the next one is asked for, no answer comes. That one counts.
    """

    name: str
    reason: DiscardReason
    happen: Callable[[Way], object]
    late: bool = False
    arrives: int = 1
    clock_s: float = 0.0
    overtaken: bool = False
    hangs: bool = False


def _another_phase(way: Way) -> None:
    way.look(phase=f"not {way.item.phase}")


def _another_calibration(way: Way) -> None:
    way.look(calibration_epoch=f"not {way.item.calibration_epoch}")


def _pushed_away(way: Way) -> None:
    way.look(divergence_m=2 * way.executor.cell.execution.maximum_divergence_m)


def _a_body_moved(way: Way) -> None:
    """Every body is seen elsewhere; of a task without any, a scene that cannot be read."""
    aside_m = np.array([0.0, ASIDE_M + way.executor.cell.execution.maximum_scene_shift_m, 0.0])
    seen = {name: (np.asarray(at) + aside_m, turn) for name, (at, turn) in way.poses.items()}
    way.executor.see(way.now_s, seen or UNKNOWN)


def _force(way: Way) -> None:
    """A force above the limit of the phase, or of every phase if the task names no such one."""
    limits = way.executor.cell.execution.force_limit_n
    way.supervisor.observe_force(way.now_s, 2 * max(limits.values()), way.item.phase)


def _stopped_and_reset(way: Way) -> None:
    way.supervisor.emergency_stop(way.now_s)
    way.supervisor.human_reset(way.now_s, "spotter")


def _driven_by_hand(way: Way) -> None:
    way.executor.intervene(way.now_s)
    way.executor.hand_back(way.now_s)


def _reset(way: Way) -> None:
    way.executor.reset(way.now_s)
    way.look()


def _another_supervisor(way: Way) -> None:
    """The one before died; whether it had stopped, nobody knows."""
    way.executor.stub.supervisor = Supervisor(way.executor.cell.execution, way.journal)


def _nothing(way: Way) -> None:
    """Only the way itself was too long, the chunk takes it twice, or another arrives before it."""


HAPPENED: tuple[tuple[str, DiscardReason, Callable[[Way], object]], ...] = (
    ("phase_change", DiscardReason.PHASE_TRANSITION, _another_phase),
    ("calibration_change", DiscardReason.CALIBRATION_MISMATCH, _another_calibration),
    ("divergence", DiscardReason.OBSERVATION_DIVERGENCE, _pushed_away),
    ("moved_body", DiscardReason.OBSERVATION_DIVERGENCE, _a_body_moved),
    ("force_event", DiscardReason.FORCE_EVENT, lambda w: w.executor.force_event(w.now_s)),
    ("collision_event", DiscardReason.COLLISION_EVENT,
     lambda w: w.executor.collision_event(w.now_s)),
    ("force_stop", DiscardReason.STOPPED, _force),
    ("collision_stop", DiscardReason.STOPPED,
     lambda w: w.supervisor.observe_collision(w.now_s, True)),
    ("emergency_stop", DiscardReason.STOPPED, lambda w: w.supervisor.emergency_stop(w.now_s)),
    ("cleared_stop", DiscardReason.STOPPED, _stopped_and_reset),
    ("supervisor_restart", DiscardReason.STOPPED, _another_supervisor),
    ("intervention", DiscardReason.INTERVENTION, lambda w: w.executor.intervene(w.now_s)),
    ("handed_back", DiscardReason.INTERVENTION, _driven_by_hand),
    ("reset", DiscardReason.RESET, _reset),
    ("other_weights", DiscardReason.CHECKPOINT_MISMATCH,
     lambda w: w.executor.set_active(w.now_s, OTHER, w.sampler)),
    ("other_sampler", DiscardReason.SAMPLER_MISMATCH,
     lambda w: w.executor.set_active(w.now_s, w.checkpoint, OTHER)),
    ("other_controller", DiscardReason.STOPPED,
     lambda w: w.executor.controller(w.now_s, "another mode")),
    ("fallback", DiscardReason.STOPPED, lambda w: w.executor.begin_fallback(w.now_s)),
)  # fmt: skip
INCIDENTS: tuple[Incident, ...] = (
    *(Incident(f"{name}{SUFFIX}", reason, happen) for name, reason, happen in HAPPENED),
    Incident(f"delay{SUFFIX}", DiscardReason.STALE_OBSERVATION, _nothing, late=True),
    Incident(f"clock_forward{SUFFIX}", DiscardReason.END_OF_EPISODE, _nothing,
             clock_s=CLOCK_STEP_S),
    Incident(f"clock_backward{SUFFIX}", DiscardReason.END_OF_EPISODE, _nothing,
             clock_s=-CLOCK_STEP_S),
    Incident(f"copy{SUFFIX}", DiscardReason.DUPLICATE, _nothing, arrives=2),
    Incident(f"overtaken{SUFFIX}", DiscardReason.OUT_OF_ORDER, _nothing, overtaken=True),
    Incident(f"policy_hang{SUFFIX}", DiscardReason.EXPIRED, _nothing, hangs=True),
)  # fmt: skip
"""Every incident, once. On a clock that is not believed nothing is commanded, and what waits
is there at the end."""
