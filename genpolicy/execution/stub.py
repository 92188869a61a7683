"""The controller stub: the last check before a controller, and the end of the road.

It asks every question about freshness again, with bookkeeping and code of its own, counts what
arrives, and moves nothing: there is no controller behind it. A refusal means hold.
"""

import hashlib
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import ChunkMetadata, DiscardReason
from genpolicy.execution.journal import Journal, encode_actions
from genpolicy.execution.settings import ExecutorSettings, known_checks, to_ns
from genpolicy.execution.supervisor import Supervisor

if TYPE_CHECKING:
    from genpolicy.feasibility.admission import Admitted

Array = NDArray[np.float64]


class ControllerStub:
    """Accepts or refuses one action at a time.

    Args:
        settings: The same limits that the executor is held to.
        journal: Where arrivals go.
        supervisor: The independent gate; while it stops, nothing is accepted.
        disabled_checks: For tests of the checker only; names of `CHECKS`.

    Attributes:
        arrivals: Actions offered.
        accepted: Actions accepted.
        stale: Offers refused because the chunk was not fresh, in order, or allowed now.
        invalid: Offers refused because the action is not the admitted one.
    """

    def __init__(
        self,
        settings: ExecutorSettings,
        journal: Journal,
        supervisor: Supervisor,
        *,
        disabled_checks: frozenset[str] = frozenset(),
    ) -> None:
        self.supervisor = supervisor
        self.arrivals = self.accepted = self.stale = self.invalid = 0
        self._settings = settings
        self._journal = journal
        self._disabled = known_checks(disabled_checks)
        self._maximum_age_ns = settings.maximum_age_ns
        self._seen_ns: int | None = None
        self._phase = self._calibration = ""
        self._identity = {"policy": ("", ""), "fallback": (settings.fallback_hash,) * 2}
        self._session_epoch = 0
        self._mode = "run"
        self._not_before: list[tuple[str, DiscardReason, int]] = []
        self._last_due_ns: int | None = None
        self._last_sequence = -1

    def hear_observation(
        self, now_ns: int, event_ns: int, phase: str, calibration_epoch: str
    ) -> None:
        """Its own view of phase, calibration and newest observation."""
        if event_ns > now_ns or (self._seen_ns is not None and event_ns < self._seen_ns):
            return
        if self._phase != phase and self._seen_ns is not None:
            self.void("phase_transition", DiscardReason.PHASE_TRANSITION, event_ns)
        if self._calibration != calibration_epoch and self._seen_ns is not None:
            self.void("calibration_mismatch", DiscardReason.CALIBRATION_MISMATCH, event_ns)
        self._seen_ns, self._phase, self._calibration = event_ns, phase, calibration_epoch

    def hear_active(self, checkpoint: str, sampler: str) -> None:
        """Which weights and sampler may command."""
        self._identity["policy"] = (checkpoint, sampler)

    def hear_mode(self, mode: str) -> None:
        """Who may command: run (the policy), fallback, intervention or ended (nobody)."""
        self._mode = mode

    def hear_reset(self, now_ns: int, session_epoch: int) -> None:
        """A new session: nothing from before is accepted."""
        self._session_epoch = session_epoch
        self._seen_ns = self._last_due_ns = None
        self.void("session_epoch", DiscardReason.RESET, now_ns)

    def void(self, check: str, reason: DiscardReason, time_ns: int) -> None:
        """Nothing conditioned before `time_ns` is accepted from now on."""
        self._not_before = [item for item in self._not_before if item[0] != check]
        self._not_before.append((check, reason, time_ns))

    def poll(self, now_s: float) -> None:
        """The consumer's own clock: runs the watchdog also while the executor is paused."""
        now_ns = self._journal.clock(now_s)
        if self.supervisor.poll(now_ns):
            self.hold(now_ns, "watchdog")

    def hold(self, now_ns: int, reason: str) -> None:
        """The controller keeps its last target."""
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
            now_ns: Time of acceptance.

        Returns:
            None when accepted.
        """
        self.arrivals += 1
        reason = self._not_the_admitted_row(admitted, action, row)
        if reason is not None:
            self.invalid += 1
        else:
            reason = self._not_fresh(admitted.metadata, row, source, sequence, now_ns)
            self.stale += reason is not None
        place = {"arrival": arrival, "chunk_id": admitted.metadata.chunk_id, "row": row}
        if reason is not None:
            self._journal.add("refuse", now_ns, {**place, "reason": str(reason)})
            return reason
        self.accepted += 1
        self._last_sequence = sequence
        self._last_due_ns = self._due_ns(admitted.metadata, row)
        self.supervisor.heard_accept(now_ns)
        age_ns = now_ns - to_ns(admitted.metadata.condition_observation_event_time_s)
        payload = {**place, "sequence": sequence, "age_ns": age_ns}
        payload["action"] = encode_actions(action)
        self._journal.add("fallback" if source == "fallback" else "accept", now_ns, payload)
        return None

    def _not_the_admitted_row(
        self, admitted: "Admitted", action: Array, row: int
    ) -> DiscardReason | None:
        rows = admitted.actions
        allowed = len(rows)
        if "execution_horizon" not in self._disabled:
            allowed = min(allowed, self._settings.execution_horizon)
        first, last = admitted.verdict.rows
        unchecked = not first <= row < last and "checked_rows" not in self._disabled
        if unchecked or not 0 <= row < allowed:
            return DiscardReason.INFEASIBLE
        whole = np.ascontiguousarray(rows, dtype="<f8")
        if "action_hash" not in self._disabled:
            if hashlib.sha256(whole.tobytes()).hexdigest() != admitted.actions_sha256:
                return DiscardReason.INFEASIBLE
            if np.asarray(action, dtype="<f8").tobytes() != whole[row].tobytes():
                return DiscardReason.INFEASIBLE
        return None

    def _not_fresh(
        self, chunk: ChunkMetadata, row: int, source: str, sequence: int, now_ns: int
    ) -> DiscardReason | None:
        seen_ns = to_ns(chunk.condition_observation_event_time_s)
        due_ns = self._due_ns(chunk, row)
        checkpoint, sampler = self._identity[source]
        ahead = self._seen_ns is None or seen_ns > self._seen_ns or seen_ns > now_ns
        old = now_ns - seen_ns > self._maximum_age_ns.get(self._phase, -1)
        going_back = sequence <= self._last_sequence or (
            self._last_due_ns is not None and due_ns <= self._last_due_ns
        )
        in_window = due_ns <= now_ns < due_ns + self._settings.period_ns
        faults = (
            ("stopped", self.supervisor.stopped, DiscardReason.STOPPED),
            ("stopped", seen_ns < self.supervisor.resumed_ns, DiscardReason.STOPPED),
            ("stopped", (source, self._mode) in (("policy", "fallback"), ("fallback", "run")),
             DiscardReason.STOPPED),
            ("intervention", self._mode == "intervention", DiscardReason.INTERVENTION),
            ("end_of_episode", self._mode == "ended", DiscardReason.END_OF_EPISODE),
            ("session_epoch", chunk.session_epoch != self._session_epoch, DiscardReason.RESET),
            ("checkpoint_mismatch", chunk.policy_checkpoint_hash != checkpoint,
             DiscardReason.CHECKPOINT_MISMATCH),
            ("sampler_mismatch", chunk.sampler_config_hash != sampler,
             DiscardReason.SAMPLER_MISMATCH),
            ("phase_transition", chunk.task_phase != self._phase, DiscardReason.PHASE_TRANSITION),
            ("calibration_mismatch", chunk.calibration_epoch != self._calibration,
             DiscardReason.CALIBRATION_MISMATCH),
            ("future_observation", ahead, DiscardReason.FUTURE_OBSERVATION),
            ("stale_observation", old, DiscardReason.STALE_OBSERVATION),
            ("expired", now_ns > to_ns(chunk.valid_until_s), DiscardReason.EXPIRED),
            ("window", not in_window, DiscardReason.EXPIRED),
            ("out_of_order", going_back, DiscardReason.OUT_OF_ORDER),
            *((check, seen_ns < time_ns, reason) for check, reason, time_ns in self._not_before),
        )  # fmt: skip
        for check, faulty, reason in faults:
            if faulty and check not in self._disabled:
                return reason
        return None

    @staticmethod
    def _due_ns(chunk: ChunkMetadata, row: int) -> int:
        return to_ns(chunk.action_start_time_s) + row * to_ns(chunk.action_period_s)
