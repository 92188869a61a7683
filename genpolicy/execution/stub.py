"""The controller stub: the last check before a controller, and the end of the road.

It is a second look: it follows phase, calibration, weights, resets and voiding events by itself,
reads the offered chunk anew, and believes nothing of what the executor concluded. The
questions are the executor's, from one table (`checks`): two wordings of "stale" would be two
definitions, and the laxer one would hold. That the one wording is right is proved by another: the
independent checker (`genpolicy.verification`) imports nothing of this. A refusal means hold; there
is no controller behind it.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import DiscardReason
from genpolicy.execution.arrival import read_chunk, shape_of
from genpolicy.execution.cell import Cell
from genpolicy.execution.checks import CHECKS, Checks, Place, refusal
from genpolicy.execution.continuity import Continuity, bytes_of
from genpolicy.execution.issued import issued_by_feasibility
from genpolicy.execution.journal import Journal, encode_actions
from genpolicy.execution.moment import ExecutorMode, Moment, Position, View
from genpolicy.execution.scene import Scene
from genpolicy.execution.supervisor import Supervisor

if TYPE_CHECKING:
    from genpolicy.feasibility.admission import Admitted

Array = NDArray[np.float64]

WATCHDOG = "watchdog"
"""Why the controller holds where nobody commanded for too long."""


class ControllerStub:
    """Accepts or refuses one action at a time.

    Args:
        cell: The same limits that the executor is held to.
        journal: Where arrivals go.
        supervisor: The independent gate; while it stops, nothing is accepted. Another may take its
            place, and begins stopped.
        checks: The table; its rows of the place `STUB` are asked.

    Attributes:
        arrivals: Actions offered.
        accepted: Actions accepted.
        stale: Offers refused because the chunk was not fresh, in order, or allowed now.
        invalid: Offers refused because the action is not the admitted one.
    """

    def __init__(
        self,
        cell: Cell,
        journal: Journal,
        supervisor: Supervisor,
        *,
        checks: Checks = CHECKS,
    ) -> None:
        self.supervisor = supervisor
        self.arrivals = self.accepted = self.stale = self.invalid = 0
        self.checks = checks
        self._journal = journal
        self._cell = cell
        self._view = cell.first_view()
        self._last_due_ns: int | None = None
        self._last_sequence = -1
        self._continuity = Continuity()

    def note_observation(
        self,
        now_ns: int,
        event_ns: int,
        phase: str,
        calibration_epoch: str,
        divergence_m: float | None = None,
        *,
        tcp_m: Position | None = None,
    ) -> None:
        """Its own view of phase, calibration and newest observation, and of where the arm is."""
        old, seen_ns = self._view, self._view.newest_observation_ns
        ignored = old.ignores(event_ns, now_ns)
        moment = Moment(now_ns=now_ns, view=old, divergence_m=divergence_m)
        if refusal(self.checks, Place.OBSERVED, moment) is not None:
            self.void(DiscardReason.OBSERVATION_DIVERGENCE, now_ns if ignored else event_ns)
        if ignored:
            return
        if old.phase != phase and seen_ns is not None:
            self.void(DiscardReason.PHASE_TRANSITION, event_ns)
        if old.calibration_epoch != calibration_epoch and seen_ns is not None:
            self.void(DiscardReason.CALIBRATION_MISMATCH, event_ns)
        self._view = self._cell.view_after(
            self._view, event_ns=event_ns, phase=phase, epoch=calibration_epoch, tcp_m=tcp_m
        )

    def note_scene(self, scene: Scene | None) -> None:
        """Where bodies were seen."""
        self._view = replace(self._view, scene=scene)

    def note_active(self, checkpoint: str, sampler: str) -> None:
        """Which weights and sampler may command."""
        self._view = replace(self._view, checkpoint=checkpoint, sampler=sampler)

    def note_controller(self, mode: str) -> None:
        """Which mode the controller is in."""
        self._view = replace(self._view, controller=mode)

    def note_mode(self, mode: str) -> None:
        """Who may command: run (the policy), fallback, intervention or ended (nobody)."""
        if mode == ExecutorMode.INTERVENTION:
            self._continuity.forget()
        self._view = replace(self._view, mode=mode)

    def note_reset(self, now_ns: int, session_epoch: int) -> None:
        """A new session: nothing from before is accepted."""
        self._view = replace(
            self._view, session_epoch=session_epoch, newest_observation_ns=None, tcp_m=None
        )
        self._last_due_ns = None
        self._continuity.forget()
        self.void(DiscardReason.RESET, now_ns)

    def void(self, reason: DiscardReason, before_ns: int, arrivals: int = 0) -> None:
        """Nothing seen before `before_ns`, and none of the first `arrivals`, is accepted now."""
        self._view = self._view.voided(reason, before_ns, arrivals)

    def poll(self, now_s: float) -> None:
        """The consumer's own clock: runs the watchdog also while the executor is paused."""
        now_ns = self._journal.clock(now_s)
        if self._view.mode == ExecutorMode.ENDED:
            return
        if self._journal.doubt:
            self.supervisor.doubt(now_ns, self._journal.doubt)
            self.hold(now_ns, self._journal.doubt)
        elif self.supervisor.poll(now_ns):
            self.hold(now_ns, WATCHDOG)

    def hold(self, now_ns: int, reason: str) -> None:
        """The controller keeps its last target."""
        if self._journal.doubt:
            self._continuity.held()
        elif reason == WATCHDOG:
            self._continuity.held(now_ns)
        self._journal.add("hold", now_ns, {"reason": reason})

    def offer(
        self,
        admitted: "Admitted",
        action: Array,
        *,
        row: int,
        source: str,
        arrival: int,
        sequence: int,
        now_ns: int,
    ) -> DiscardReason | None:
        """Accept one action, or name the reason for holding instead.

        Args:
            admitted: The chunk that the action claims to come from.
            action: The action. Shape (10,).
            row: Which row of the chunk it claims to be.
            source: policy or fallback.
            arrival: The executor's number of the chunk.
            sequence: Grows with every offer.
            now_ns: Time of acceptance; where the session has seen a later one, that.

        Returns:
            None when accepted.
        """
        self.arrivals += 1
        now_ns = max(now_ns, self._journal.latest_ns)  # no chunk is young by an old time
        known = isinstance(source, str) and type(row) is type(sequence) is int
        about = read_chunk(admitted, source=source, arrival=arrival) if known else None
        place = {"arrival": arrival, "chunk_id": shape_of(admitted)[1], "row": row}
        if about is None:
            return self._refuse(now_ns, {**place, "row": -1}, DiscardReason.INFEASIBLE)
        self._continuity.after(self.supervisor.resumed_ns)
        moment = Moment(
            now_ns=now_ns,
            view=self._present(),
            about=about,
            row=row,
            issued=issued_by_feasibility(admitted),
            same_action=_is_row(admitted, action, row),
            follows=self._continuity.follows(admitted, about, row, now_ns, self._view),
            last_due_ns=self._last_due_ns,
            last_accept_ns=self._continuity.given_ns,
            sequence=sequence,
            last_sequence=self._last_sequence,
        )
        check = refusal(self.checks, Place.STUB, moment)
        if check is not None:
            assert check.reason is not None, "a row that is asked here has a reason"
            return self._refuse(now_ns, place, check.reason)
        self.accepted += 1
        self._last_sequence = sequence
        self._last_due_ns = moment.due_ns
        self._continuity.note(now_ns, admitted, row, action)
        self.supervisor.note_accepted(now_ns)
        payload = {**place, "sequence": sequence, "age_ns": now_ns - about.times.condition_ns}
        payload["action"] = encode_actions(action)
        self._journal.add("fallback" if source == "fallback" else "accept", now_ns, payload)
        return None

    def _present(self) -> View:
        """Its view, with what its supervisor says now."""
        view = self._view.voided(DiscardReason.STOPPED, self.supervisor.resumed_ns)
        return replace(view, stopped=self.supervisor.stopped)

    def _refuse(
        self, now_ns: int, place: dict[str, object], reason: DiscardReason
    ) -> DiscardReason:
        self.invalid += reason is DiscardReason.INFEASIBLE
        self.stale += reason is not DiscardReason.INFEASIBLE
        self._journal.add("refuse", now_ns, {**place, "reason": str(reason)})
        return reason


def _is_row(admitted: "Admitted", action: Array, row: int) -> bool:
    """The action is that row of the chunk, bit for bit."""
    if not 0 <= row < len(admitted.actions):
        return False
    return bytes_of(action) == bytes_of(admitted.actions[row])
