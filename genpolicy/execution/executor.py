"""The receding-horizon executor: decides which admitted action goes to the stub, at this moment.

Row j of a chunk is due in `[start + j * period, start + (j + 1) * period)`, j < H_e. Rows whose
window has passed are skipped, never caught up. The newest valid chunk replaces the rest of older
ones from its start on. Whatever is doubtful is discarded with one reason, and the answer is hold.
"""

import math
from collections.abc import Callable

from genpolicy.contract.chunk import ChunkMetadata, DiscardReason
from genpolicy.execution.arrival import (
    context_refusal,
    is_whole,
    issued_by_feasibility,
    shape_of,
    standing_refusal,
)
from genpolicy.execution.chunk_queue import ChunkQueue
from genpolicy.execution.command import Command, Mode
from genpolicy.execution.freshness import Situation
from genpolicy.execution.journal import Journal, session_payload
from genpolicy.execution.ledger import FALLBACK, POLICY, ChunkTimes, Conservation
from genpolicy.execution.settings import NS_PER_S, ExecutorSettings, known_checks, to_ns
from genpolicy.execution.stub import ControllerStub
from genpolicy.feasibility.admission import Admitted


class Executor:
    """Queue, freshness and hand-over of admitted chunks; pure: every time is passed in.

    Args:
        settings: Horizons, periods, ages.
        journal: Where every event goes; one journal, one session.
        stub: The controller stub with its supervisor.
        disabled_checks: For tests of the checker only; names of `CHECKS`.
        genuine: Tells a chunk that feasibility issued from an imitation. Another rule than the
            default is for tests only and is declared in the journal.

    Attributes:
        observations_ignored: Observations dropped as older than one already used, or from the
            future.
        clock_faults: Calls with a time before an earlier one; they are treated as that earlier
            time, and a tick among them holds.
        mode: Who commands.
    """

    def __init__(
        self,
        settings: ExecutorSettings,
        journal: Journal,
        stub: ControllerStub,
        *,
        disabled_checks: frozenset[str] = frozenset(),
        genuine: Callable[[object], bool] = issued_by_feasibility,
    ) -> None:
        self.settings = settings
        self.stub = stub
        self.observations_ignored = self.clock_faults = 0
        self.mode = Mode.RUN
        self._journal = journal
        self._disabled = known_checks(disabled_checks)
        self._genuine = genuine
        self._situation = Situation()
        self._queue = ChunkQueue(settings, journal, self._disabled)
        self._seen_ids: set[str] = set()
        self._in_flight: set[str] = set()
        self._sequence = 0
        self._stops_seen = 0
        self._begun = False

    # -- what the world says ------------------------------------------------------------------

    def observe(
        self,
        now_s: float,
        event_time_s: float,
        phase: str,
        calibration_epoch: str,
        divergence_m: float | None = None,
    ) -> bool:
        """Take note of an observation; one older than the newest is ignored and counted.

        Args:
            now_s: Time, s.
            event_time_s: When its newest sensor was exposed, s.
            phase: Task phase.
            calibration_epoch: Calibration of its sensors.
            divergence_m: Distance of measured from commanded TCP, if known, m.

        Returns:
            Whether it was used.
        """
        now_ns = self._begin(now_s)
        event_ns = to_ns(event_time_s) if math.isfinite(event_time_s * NS_PER_S) else now_ns + 1
        newest_ns = self._situation.newest_observation_ns
        ignored = "future" if event_ns > now_ns else ""
        if not ignored and newest_ns is not None and event_ns < newest_ns:
            ignored = "older"
        payload = {
            "event_time_ns": event_ns, "phase": phase, "calibration_epoch": calibration_epoch,
            "used": not ignored, "ignored_because": ignored,
        }  # fmt: skip
        self._journal.add("observation", now_ns, payload)
        self.stub.hear_observation(now_ns, event_ns, phase, calibration_epoch)
        if ignored:
            self.observations_ignored += 1
            return False
        first = newest_ns is None
        self._situation.newest_observation_ns = event_ns
        old_phase, old_epoch = self._situation.phase, self._situation.calibration_epoch
        self._situation.phase, self._situation.calibration_epoch = phase, calibration_epoch
        for kind, old, new, reason in (
            ("phase", old_phase, phase, DiscardReason.PHASE_TRANSITION),
            ("epoch", old_epoch, calibration_epoch, DiscardReason.CALIBRATION_MISMATCH),
        ):
            if old != new:
                change = {"event_time_ns": event_ns, "old": old, "new": new}
                self._journal.add(kind, now_ns, change)
                if not first:
                    self._situation.void(reason, event_ns)
                    self._queue.drop(now_ns, reason, str(reason))
        if divergence_m is not None and not self.settings.maximum_divergence_m - divergence_m >= 0:
            self._invalidate(now_ns, event_ns, DiscardReason.OBSERVATION_DIVERGENCE)
        return True

    def force_event(self, now_s: float) -> None:
        """A force event: everything conditioned before now is void."""
        now_ns = self._begin(now_s)
        self._invalidate(now_ns, now_ns, DiscardReason.FORCE_EVENT)

    def collision_event(self, now_s: float) -> None:
        """A collision event: everything conditioned before now is void."""
        now_ns = self._begin(now_s)
        self._invalidate(now_ns, now_ns, DiscardReason.COLLISION_EVENT)

    def set_active(self, now_s: float, checkpoint_hash: str, sampler_hash: str) -> None:
        """Name the weights and the sampler that may command; what others made is discarded."""
        now_ns = self._begin(now_s)
        active = {"checkpoint": checkpoint_hash, "sampler": sampler_hash}
        self._journal.add("active", now_ns, active)
        self.stub.hear_active(checkpoint_hash, sampler_hash)
        situation = self._situation
        old = (situation.checkpoint, situation.sampler)
        situation.checkpoint, situation.sampler = checkpoint_hash, sampler_hash
        if old[0] != checkpoint_hash:
            reason = DiscardReason.CHECKPOINT_MISMATCH
            self._queue.drop(now_ns, reason, "checkpoint_mismatch", source=POLICY)
        if old[1] != sampler_hash:
            reason = DiscardReason.SAMPLER_MISMATCH
            self._queue.drop(now_ns, reason, "sampler_mismatch", source=POLICY)

    # -- who commands -------------------------------------------------------------------------

    def reset(self, now_s: float) -> None:
        """A new session begins: chunks, observations and invocations of the old one are void.

        It clears no stop of the supervisor; a person does.
        """
        now_ns = self._begin(now_s)
        situation = self._situation
        situation.session_epoch += 1
        self._journal.add("reset", now_ns, {"session_epoch": situation.session_epoch})
        self._queue.drop(now_ns, DiscardReason.RESET, "session_epoch")
        situation.newest_observation_ns = None
        situation.void(DiscardReason.RESET, now_ns)
        self._in_flight.clear()
        self._queue.forget()
        self.stub.hear_reset(now_ns, situation.session_epoch)
        if self.mode is not Mode.ENDED:
            self._enter(now_ns, Mode.RUN)

    def intervene(self, now_s: float) -> None:
        """A person takes over: policy and fallback are discarded until `hand_back`."""
        now_ns = self._begin(now_s)
        self._enter(now_ns, Mode.INTERVENTION)
        self._queue.drop(now_ns, DiscardReason.INTERVENTION, "intervention")

    def hand_back(self, now_s: float) -> None:
        """The person hands back; chunks conditioned before now stay void."""
        now_ns = self._begin(now_s)
        if self.mode is Mode.INTERVENTION:
            self._enter(now_ns, Mode.RUN)
            self._invalidate(now_ns, now_ns, DiscardReason.INTERVENTION)

    def begin_fallback(self, now_s: float) -> None:
        """The task's classical fallback commands; the policy's chunks are discarded."""
        now_ns = self._begin(now_s)
        if self.mode is Mode.RUN:
            self._enter(now_ns, Mode.FALLBACK)
            self._queue.drop(now_ns, DiscardReason.STOPPED, "stopped")

    def end_fallback(self, now_s: float) -> None:
        """The policy may command again, on observations from now on."""
        now_ns = self._begin(now_s)
        if self.mode is Mode.FALLBACK:
            self._enter(now_ns, Mode.RUN)
            self._invalidate(now_ns, now_ns, DiscardReason.STOPPED)

    def end_episode(self, now_s: float) -> Conservation:
        """Discard what is left, write the balances down and accept nothing more."""
        now_ns = self._begin(now_s)
        self._queue.drop(now_ns, DiscardReason.END_OF_EPISODE, "end_of_episode")
        self._enter(now_ns, Mode.ENDED)
        balance = self.conservation()
        payload = {
            "chunks": balance.chunks.as_dict(),
            "actions": balance.actions.as_dict(),
            "events": len(self._journal),
        }
        self._journal.add("end", now_ns, payload)
        return balance

    # -- invocations and chunks ---------------------------------------------------------------

    @property
    def session_epoch(self) -> int:
        """What a chunk made now must carry."""
        return self._situation.session_epoch

    @property
    def chain_head(self) -> str:
        """The predecessor that a chunk made now must name; empty for an explicit re-plan."""
        return self._queue.head or ""

    def needs_invocation(self, now_s: float) -> bool:
        """Whether to start an invocation: few executable actions left and none in flight."""
        if self._in_flight or self.stub.supervisor.stopped:
            return False
        if self.mode not in (Mode.RUN, Mode.FALLBACK):
            return False
        now_ns = self._journal.clock(now_s)
        return self._queue.remaining(now_ns) <= self.settings.replan_lead_steps

    def begin_invocation(self, now_s: float, invocation_id: str) -> None:
        """An invocation is in flight until `end_invocation` or a reset."""
        now_ns = self._begin(now_s)
        self._in_flight.add(invocation_id)
        payload = {"id": invocation_id, "stage": "begin", "detail": ""}
        self._journal.add("invocation", now_ns, payload)

    def end_invocation(self, now_s: float, invocation_id: str, detail: str = "") -> None:
        """The invocation answered, failed or was given up; `detail` says which."""
        now_ns = self._begin(now_s)
        self._in_flight.discard(invocation_id)
        payload = {"id": invocation_id, "stage": "end", "detail": detail}
        self._journal.add("invocation", now_ns, payload)

    def deliver(self, admitted: Admitted, now_s: float) -> DiscardReason | None:
        """Enqueue a chunk of the policy, or discard it.

        Returns:
            None if enqueued, else why not.
        """
        return self._arrive(admitted, self._begin(now_s), POLICY)

    def deliver_fallback(self, admitted: Admitted, now_s: float) -> DiscardReason | None:
        """Enqueue a chunk of the task's fallback; only in fallback mode, same checks."""
        return self._arrive(admitted, self._begin(now_s), FALLBACK)

    def write_off(
        self, metadata: ChunkMetadata, rows: int, reason: DiscardReason, now_s: float
    ) -> None:
        """Account for a chunk that never became deliverable.

        Args:
            metadata: Of the chunk.
            rows: Its number of actions, K.
            reason: `infeasible` if a layer rejected it; `expired` if it was lost or cancelled.
            now_s: Time, s.
        """
        now_ns = self._begin(now_s)
        if metadata.chunk_id in self._seen_ids:
            reason = DiscardReason.DUPLICATE
        self._seen_ids.add(metadata.chunk_id)
        self._refuse(now_ns, self._queue.arrive(rows), metadata.chunk_id, rows, reason)

    def conservation(self) -> Conservation:
        """`generated = executed + discarded by reason + still queued`, chunks and actions."""
        return self._queue.conservation()

    def tick(self, now_s: float) -> Command:
        """The command of this moment; also sweeps out what has become stale, before anything."""
        faults = self.clock_faults
        now_ns = self._begin(now_s)
        if self.clock_faults != faults:
            return self._hold(now_ns, "clock_backwards")
        self.stub.poll(now_s)
        self._heed_supervisor(now_ns)
        if self.stub.supervisor.stopped and "stopped" not in self._disabled:
            self._hold(now_ns, "stopped")
            return Command("stop", str(self.stub.supervisor.state))
        self._queue.sweep(now_ns, self._situation)
        if self.mode is Mode.ENDED and "end_of_episode" not in self._disabled:
            return Command("hold", "ended")
        chunk = self._queue.due(now_ns)
        if chunk is None:
            return self._hold(now_ns, "intervention" if self.mode is Mode.INTERVENTION else "empty")
        row = chunk.next_row
        action = chunk.admitted.actions[row]
        self._sequence += 1
        reason = self.stub.offer(
            chunk.admitted,
            action,
            row=row,
            source=chunk.source,
            arrival=chunk.arrival,
            sequence=self._sequence,
            now_ns=now_ns,
        )
        if reason is not None:
            self._queue.close(now_ns, chunk, reason, at="stub")
            return self._hold(now_ns, f"refused: {reason}")
        self._queue.took(now_ns, chunk)
        kind = "fallback" if chunk.source == FALLBACK else "action"
        return Command(kind, "", action, chunk.chunk_id, row)

    # -- inside -------------------------------------------------------------------------------

    def _begin(self, now_s: float) -> int:
        """Now in ns, never before an earlier now; the first call opens the journal."""
        if to_ns(now_s) < self._journal.latest_ns:
            self.clock_faults += 1
        now_ns = self._journal.clock(now_s)
        if not self._begun:
            self._begun = True
            payload = session_payload(
                self.settings,
                labels=self._journal.labels,
                disabled=self._disabled,
                genuine=self._genuine is issued_by_feasibility,
            )
            self._journal.add("session", now_ns, payload)
        return now_ns

    def _arrive(self, admitted: Admitted, now_ns: int, source: str) -> DiscardReason | None:
        self._heed_supervisor(now_ns)
        rows, chunk_id = shape_of(admitted)
        arrival = self._queue.arrive(rows)
        genuine = self._genuine(admitted)
        reason = self._arrival_refusal(admitted, now_ns, source, genuine=genuine)
        if genuine:  # an imitation must not use up the name of a chunk to come
            self._seen_ids.add(chunk_id)
        if reason is not None:
            self._refuse(now_ns, arrival, chunk_id, rows, reason)
            return reason
        times = ChunkTimes.of(admitted.metadata)
        self._queue.enqueue(now_ns, admitted, arrival=arrival, times=times, source=source)
        return None

    def _arrival_refusal(
        self, admitted: Admitted, now_ns: int, source: str, *, genuine: bool
    ) -> DiscardReason | None:
        reason = standing_refusal(
            self.mode,
            source,
            known=genuine and admitted.metadata.chunk_id in self._seen_ids,
            whole=genuine
            and is_whole(admitted, period_ns=self.settings.period_ns, disabled=self._disabled),
            stopped=self.stub.supervisor.stopped,
            disabled=self._disabled,
        )
        if reason is not None:
            return reason
        return context_refusal(
            admitted,
            self._situation,
            now_ns=now_ns,
            source=source,
            settings=self.settings,
            disabled=self._disabled,
        ) or self._queue.order_refusal(
            ChunkTimes.of(admitted.metadata), admitted.metadata.predecessor_chunk_id
        )

    def _refuse(
        self, now_ns: int, arrival: int, chunk_id: str, rows: int, reason: DiscardReason
    ) -> None:
        self._queue.refuse(
            now_ns, arrival=arrival, chunk_id=chunk_id, rows=rows, reason=str(reason)
        )

    def _heed_supervisor(self, now_ns: int) -> None:
        supervisor = self.stub.supervisor
        if supervisor.stops != self._stops_seen:
            self._stops_seen = supervisor.stops
            self._queue.drop(now_ns, DiscardReason.STOPPED, "stopped")
        self._situation.void(DiscardReason.STOPPED, supervisor.resumed_ns)

    def _invalidate(self, now_ns: int, before_ns: int, reason: DiscardReason) -> None:
        """Void what was conditioned before `before_ns`, here and at the stub."""
        self._journal.add("invalidate", now_ns, {"reason": str(reason), "before_ns": before_ns})
        self._situation.void(reason, before_ns)
        self.stub.void(str(reason), reason, before_ns)
        self._queue.drop(now_ns, reason, str(reason))

    def _enter(self, now_ns: int, mode: Mode) -> None:
        if mode is not self.mode:
            self._journal.add("mode", now_ns, {"old": str(self.mode), "new": str(mode)})
            self.mode = mode
            self.stub.hear_mode(str(mode))

    def _hold(self, now_ns: int, reason: str) -> Command:
        self.stub.hold(now_ns, reason)
        return Command("hold", reason)
