"""What the world says to an executor: observations, forces, weights, the controller's mode.

Each may void what is here. Whatever is wrong with what is said, nothing of it raises.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace

from numpy.typing import ArrayLike

from genpolicy.contract.chunk import DiscardReason
from genpolicy.execution.cell import Cell
from genpolicy.execution.checks import Checks, Place, refusal
from genpolicy.execution.journal import Journal
from genpolicy.execution.moment import Moment
from genpolicy.execution.observed import Observed, name_of
from genpolicy.execution.scene import read_scene
from genpolicy.execution.stub import ControllerStub

UNKNOWN: Mapping[str, tuple[ArrayLike, ArrayLike]] = {"": ((), ())}
"""What the journal says of a scene that could not be read: a body that no scene has, nowhere."""


class Informed(ABC):
    """The view of an executor, and what changes it.

    Args:
        cell: What it is held to.
        journal: Where every event goes.
        stub: The controller stub, which hears the same.
        checks: The table.

    Attributes:
        observations_ignored: Observations dropped as older than one already used, or from the
            future.
    """

    def __init__(self, cell: Cell, journal: Journal, stub: ControllerStub, checks: Checks) -> None:
        self.cell = cell
        self.stub = stub
        self.observations_ignored = 0
        self._journal = journal
        self._checks = checks
        self._view = cell.first_view()

    @abstractmethod
    def _begin(self, now_s: float) -> int:
        """Now in ns."""

    @abstractmethod
    def _drop(self, now_ns: int, reason: DiscardReason) -> None:
        """Discard what the checks with this reason refuse now."""

    @abstractmethod
    def _void(self, now_ns: int, reason: DiscardReason, before_ns: int) -> None:
        """Nothing seen before this time, and nothing that is here, is used."""

    @abstractmethod
    def _invalidate(self, now_ns: int, before_ns: int, reason: DiscardReason) -> None:
        """The same, on record."""

    def observe(
        self,
        now_s: float,
        event_time_s: float,
        phase: str,
        calibration_epoch: str,
        divergence_m: float | None = None,
        *,
        tcp_m: ArrayLike | None = None,
    ) -> bool:
        """Whether an observation is used; one older than the newest is ignored and counted.

        Args:
            now_s: Time, s.
            event_time_s: When its newest sensor was exposed, s.
            phase: Task phase.
            calibration_epoch: Calibration of its sensors.
            divergence_m: Distance of measured from commanded TCP, if known, m.
            tcp_m: Where the TCP was measured, if known, m. Where no command says where the arm is
                (a session begins, a person had it, a stop was cleared), nothing moves that was not
                checked from there. Shape (3,).
        """
        now_ns = self._begin(now_s)
        told = Observed.of(
            self._view, now_ns, event_time_s, phase, calibration_epoch, divergence_m, tcp_m
        )
        self._journal.add("observation", now_ns, told.payload())
        self.stub.note_observation(
            now_ns, told.event_ns, told.phase, told.calibration_epoch, told.divergence_m,
            tcp_m=told.tcp_m,
        )  # fmt: skip
        if told.ignored:
            self.observations_ignored += 1
        else:
            self._look(now_ns, told)
        # Whatever is wrong with the time of an observation, the distance was measured.
        moment = Moment(now_ns=now_ns, view=self._view, divergence_m=told.divergence_m)
        if refusal(self._checks, Place.OBSERVED, moment) is not None:
            before_ns = now_ns if told.ignored else told.event_ns
            self._invalidate(now_ns, before_ns, DiscardReason.OBSERVATION_DIVERGENCE)
        return not told.ignored

    def _look(self, now_ns: int, told: Observed) -> None:
        """The view after an observation; another phase or calibration voids what is here."""
        before, event_ns = self._view, told.event_ns
        self._view = self.cell.view_after(
            before, event_ns=event_ns, phase=told.phase, epoch=told.calibration_epoch,
            tcp_m=told.tcp_m,
        )  # fmt: skip
        for kind, old, new, reason in (
            ("phase", before.phase, told.phase, DiscardReason.PHASE_TRANSITION),
            ("epoch", before.calibration_epoch, told.calibration_epoch,
             DiscardReason.CALIBRATION_MISMATCH),
        ):  # fmt: skip
            if old != new:
                self._journal.add(kind, now_ns, {"event_time_ns": event_ns, "old": old, "new": new})
                if before.newest_observation_ns is not None:
                    self._void(now_ns, reason, event_ns)

    def see(self, now_s: float, poses: Mapping[str, tuple[ArrayLike, ArrayLike]]) -> None:
        """Where the bodies of the scene are seen now; what was checked in another scene is void.

        Args:
            now_s: Time, s.
            poses: Position, m, and unit quaternion, w x y z, by name. What cannot be read is a
                scene that nobody knows, in which nothing is executed.
        """
        now_ns, scene = self._begin(now_s), read_scene(poses)
        # What was read is noted, since what was given need not be the same when it is read again.
        told = UNKNOWN if scene is None else {n: (at[:3], at[3:]) for n, at in scene.items()}
        self._journal.scene(now_s, told)
        self.stub.note_scene(scene)
        self._view = replace(self._view, scene=scene)
        self._drop(now_ns, DiscardReason.OBSERVATION_DIVERGENCE)

    def force_event(self, now_s: float) -> None:
        """A force event: everything conditioned before now is void."""
        now_ns = self._begin(now_s)
        self._invalidate(now_ns, now_ns, DiscardReason.FORCE_EVENT)

    def collision_event(self, now_s: float) -> None:
        """A collision event: everything conditioned before now is void."""
        now_ns = self._begin(now_s)
        self._invalidate(now_ns, now_ns, DiscardReason.COLLISION_EVENT)

    def set_active(self, now_s: float, checkpoint_hash: str, sampler_hash: str) -> None:
        """Name the weights and the sampler that may command; what others made is discarded.

        What is no name names none, of which nothing may command.
        """
        now_ns, checkpoint, sampler = (
            self._begin(now_s),
            name_of(checkpoint_hash),
            name_of(sampler_hash),
        )
        self._journal.add("active", now_ns, {"checkpoint": checkpoint, "sampler": sampler})
        self.stub.note_active(checkpoint, sampler)
        self._view = replace(self._view, checkpoint=checkpoint, sampler=sampler)
        self._drop(now_ns, DiscardReason.CHECKPOINT_MISMATCH)
        self._drop(now_ns, DiscardReason.SAMPLER_MISMATCH)

    def controller(self, now_s: float, mode: str) -> None:
        """The mode that the controller is in; another one than before voids what is here."""
        now_ns, before, mode = self._begin(now_s), self._view.controller, name_of(mode)
        self._journal.add("controller", now_ns, {"mode": mode})
        self.stub.note_controller(mode)
        self._view = replace(self._view, controller=mode)
        if before not in ("", mode):
            self._void(now_ns, DiscardReason.STOPPED, now_ns)
