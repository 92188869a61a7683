"""The receding-horizon executor: decides which admitted action goes to the stub, at this moment.

Row j of a chunk is due in `[start + j * period, start + (j + 1) * period)`, j < H_e. A row whose
window has passed is never caught up, and what would follow behind it is discarded: nobody checked
the way there. The newest valid chunk replaces the rest of older ones from its start on. Whatever is
doubtful is discarded with one reason, and the answer is hold.
"""

from dataclasses import replace

from genpolicy.contract.chunk import ChunkMetadata, DiscardReason
from genpolicy.execution.arrival import Arrivals
from genpolicy.execution.cell import Cell
from genpolicy.execution.checks import CHECKS, Checks, missing
from genpolicy.execution.chunk_queue import ChunkQueue
from genpolicy.execution.command import Command
from genpolicy.execution.informed import Informed
from genpolicy.execution.journal import Journal, session_payload
from genpolicy.execution.ledger import Conservation
from genpolicy.execution.moment import FALLBACK, POLICY, ExecutorMode, View
from genpolicy.execution.nanoseconds import NEVER_NS
from genpolicy.execution.observed import name_of
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import SupervisorState
from genpolicy.feasibility.admission import Admitted


class Executor(Informed):
    """Queue, freshness and hand-over of admitted chunks; pure: every time is passed in.

    Args:
        cell: Horizons, periods, ages.
        journal: Where every event goes; one journal, one session.
        stub: The controller stub with its supervisor.
        checks: The table; a row that is missing is declared in the journal.

    Attributes:
        mode: Who commands.
    """

    def __init__(
        self,
        cell: Cell,
        journal: Journal,
        stub: ControllerStub,
        *,
        checks: Checks = CHECKS,
    ) -> None:
        super().__init__(cell, journal, stub, checks)
        self.mode = ExecutorMode.RUN
        self._queue = ChunkQueue(cell.execution.queue_capacity, journal, checks)
        self._arrivals = Arrivals(self._queue, checks)
        self._in_flight: set[str] = set()
        self._sequence = 0
        self._stops_seen = (stub.supervisor, 0)
        self._begun = False

    # -- who commands -------------------------------------------------------------------------

    def reset(self, now_s: float) -> None:
        """A new session begins: chunks, observations and invocations of the old one are void.

        It clears no stop of the supervisor and takes no command from a person; a person does.
        """
        now_ns = self._begin(now_s)
        epoch = self._view.session_epoch + 1
        self._journal.add("reset", now_ns, {"session_epoch": epoch})
        self._view = replace(
            self._view, session_epoch=epoch, newest_observation_ns=None, tcp_m=None
        )
        self._void(now_ns, DiscardReason.RESET, now_ns)
        self._in_flight.clear()
        self._queue.forget()
        self.stub.note_reset(now_ns, epoch)
        if self.mode is ExecutorMode.FALLBACK:
            self._enter(now_ns, ExecutorMode.RUN)

    def intervene(self, now_s: float) -> None:
        """A person takes over: policy and fallback are discarded until `hand_back`."""
        now_ns = self._begin(now_s)
        if self.mode is not ExecutorMode.ENDED:
            self._enter(now_ns, ExecutorMode.INTERVENTION)
            self._queue.continuity.forget()
            self._drop(now_ns, DiscardReason.INTERVENTION)

    def hand_back(self, now_s: float) -> None:
        """The person hands back; chunks conditioned before now stay void."""
        now_ns = self._begin(now_s)
        if self.mode is ExecutorMode.INTERVENTION:
            self._enter(now_ns, ExecutorMode.RUN)
            self._invalidate(now_ns, now_ns, DiscardReason.INTERVENTION)

    def begin_fallback(self, now_s: float) -> None:
        """The task's classical fallback commands; the policy's chunks are discarded."""
        now_ns = self._begin(now_s)
        if self.mode is ExecutorMode.RUN:
            self._enter(now_ns, ExecutorMode.FALLBACK)
            self._drop(now_ns, DiscardReason.STOPPED)

    def end_fallback(self, now_s: float) -> None:
        """The policy may command again, on observations from now on."""
        now_ns = self._begin(now_s)
        if self.mode is ExecutorMode.FALLBACK:
            self._enter(now_ns, ExecutorMode.RUN)
            self._invalidate(now_ns, now_ns, DiscardReason.STOPPED)

    def end_episode(self, now_s: float) -> Conservation:
        """Discard what is left, write the balances down and accept nothing more."""
        now_ns = self._begin(now_s)
        if self.mode is ExecutorMode.ENDED:
            return self.conservation()
        self._queue.drop(
            now_ns, replace(self._view, mode=ExecutorMode.ENDED), DiscardReason.END_OF_EPISODE
        )
        self._enter(now_ns, ExecutorMode.ENDED)
        balance = self.conservation()
        self._journal.add("end", now_ns, {**balance.as_dict(), "events": len(self._journal)})
        return balance

    # -- invocations and chunks ---------------------------------------------------------------

    @property
    def session_epoch(self) -> int:
        """What a chunk made now must carry."""
        return self._view.session_epoch

    @property
    def chain_head(self) -> str:
        """The predecessor that a chunk made now must name; empty for an explicit re-plan."""
        return self._queue.head or ""

    def needs_invocation(self, now_s: float) -> bool:
        """Whether to start an invocation: few executable actions left and none in flight."""
        if self._in_flight or self.stub.supervisor.stopped:
            return False
        if self.mode not in (ExecutorMode.RUN, ExecutorMode.FALLBACK):
            return False
        now_ns = self._journal.clock(now_s)
        return self._queue.remaining(now_ns) <= self.cell.execution.replan_lead_rows

    def begin_invocation(self, now_s: float, invocation_id: str, detail: str = "") -> None:
        """An invocation is in flight until `end_invocation` or a reset; `detail` goes on record.

        What is no name is one without a name, which is in flight like any other.
        """
        self._begin(now_s)
        name, told = name_of(invocation_id), name_of(detail)
        self._in_flight.add(name)
        self._journal.invocation(now_s, invocation_id=name, stage="begin", detail=told)

    def end_invocation(self, now_s: float, invocation_id: str, detail: str = "") -> None:
        """The invocation answered, failed or was given up; `detail` says which."""
        self._begin(now_s)
        name, told = name_of(invocation_id), name_of(detail)
        self._in_flight.discard(name)
        self._journal.invocation(now_s, invocation_id=name, stage="end", detail=told)

    def deliver(self, admitted: Admitted, now_s: float) -> DiscardReason | None:
        """Enqueue a chunk of the policy, or discard it; None if enqueued, else why not."""
        return self._arrive(admitted, self._begin(now_s), POLICY)

    def deliver_fallback(self, admitted: Admitted, now_s: float) -> DiscardReason | None:
        """Enqueue a chunk of the task's fallback; only in fallback mode, same checks."""
        return self._arrive(admitted, self._begin(now_s), FALLBACK)

    def write_off(
        self, metadata: ChunkMetadata, rows: int, reason: DiscardReason, now_s: float
    ) -> None:
        """Account for a chunk of so many rows that never became deliverable.

        `infeasible` if a layer rejected it; `expired` if it was lost or cancelled. What does not
        say which chunk, how many rows or why is counted all the same, as malformed, of none, or
        infeasible.
        """
        self._arrivals.write_off(self._begin(now_s), metadata, rows, reason)

    def conservation(self) -> Conservation:
        """`generated = executed + discarded by reason + still queued`, chunks and actions."""
        return self._queue.conservation()

    def tick(self, now_s: float) -> Command:
        """The command of this moment; also sweeps out what has become stale, before anything."""
        now_ns = self._begin(now_s)
        if self.mode is ExecutorMode.ENDED:
            return Command("stop" if self.stub.supervisor.stopped else "hold", "ended")
        if doubt := self._journal.doubt:
            self.stub.supervisor.doubt(now_ns, doubt)
            return self._hold(now_ns, doubt)
        if self.stub.supervisor.state is SupervisorState.WATCHDOG_HOLD:  # since before this tick
            self._queue.continuity.held()
        self.stub.poll(now_s)
        self._heed_supervisor(now_ns)
        view = self._present()
        self._queue.sweep(now_ns, view)
        chunk = self._queue.due(now_ns, view)
        if chunk is None:
            person = self.mode is ExecutorMode.INTERVENTION
            return self._hold(now_ns, "intervention" if person else "empty")
        broken = self._queue.continues(now_ns, chunk, view)
        if broken is not None:
            self._queue.close(now_ns, chunk, broken)
            return self._hold(now_ns, str(broken))
        row, action = chunk.next_row, chunk.admitted.actions[chunk.next_row]
        self._sequence += 1
        reason = self.stub.offer(
            chunk.admitted, action, row=row, source=chunk.about.source,
            arrival=chunk.about.arrival, sequence=self._sequence, now_ns=now_ns,
        )  # fmt: skip
        if reason is not None:
            self._queue.close(now_ns, chunk, reason, at="stub")
            return self._hold(now_ns, f"refused: {reason}")
        self._queue.accepted(now_ns, chunk)
        kind = "fallback" if chunk.about.source == FALLBACK else "action"
        return Command(kind, "", action, chunk.chunk_id, row)

    # -- inside -------------------------------------------------------------------------------

    def _begin(self, now_s: float) -> int:
        """Now in ns, the newest time that is believed; the first call opens the journal."""
        now_ns = self._journal.clock(now_s)
        if not self._begun:
            self._begun = True
            payload = session_payload(
                self.cell,
                labels=self._journal.labels,
                checks_missing=missing(self._checks, self.stub.checks, self.stub.supervisor.checks),
            )
            self._journal.add("session", now_ns, payload)
        return now_ns

    def _arrive(self, admitted: Admitted, now_ns: int, source: str) -> DiscardReason | None:
        self._heed_supervisor(now_ns)
        return self._arrivals.arrive(admitted, now_ns, self._present(), source)

    def _present(self) -> View:
        """The view with what the supervisor and the mode say now."""
        return replace(self._view, mode=self.mode, stopped=self.stub.supervisor.stopped)

    def _heed_supervisor(self, now_ns: int) -> None:
        supervisor = self.stub.supervisor
        if (supervisor, supervisor.stops) != self._stops_seen:
            self._stops_seen = (supervisor, supervisor.stops)
            self._void(now_ns, DiscardReason.STOPPED, NEVER_NS)
        self._view = self._view.voided(DiscardReason.STOPPED, supervisor.resumed_ns)
        self._queue.continuity.after(supervisor.resumed_ns)

    def _void(self, now_ns: int, reason: DiscardReason, before_ns: int) -> None:
        """Nothing seen before this time, and nothing that is here, is used here or at the stub."""
        self._view = self._view.voided(reason, before_ns, self._queue.arrivals)
        self.stub.void(reason, before_ns, self._queue.arrivals)
        self._drop(now_ns, reason)

    def _drop(self, now_ns: int, reason: DiscardReason) -> None:
        self._queue.drop(now_ns, self._present(), reason)

    def _invalidate(self, now_ns: int, before_ns: int, reason: DiscardReason) -> None:
        """Void what was conditioned before `before_ns`, and say so."""
        self._journal.add("invalidate", now_ns, {"reason": str(reason), "before_ns": before_ns})
        self._void(now_ns, reason, before_ns)

    def _enter(self, now_ns: int, mode: ExecutorMode) -> None:
        if mode is not self.mode:
            self._journal.add("mode", now_ns, {"old": str(self.mode), "new": str(mode)})
            self.mode = mode
            self.stub.note_mode(str(mode))

    def _hold(self, now_ns: int, reason: str) -> Command:
        """Hold for a reason; a stop where one stands."""
        supervisor = self.stub.supervisor
        self.stub.hold(now_ns, "stopped" if supervisor.stopped else reason)
        if supervisor.stopped:
            return Command("stop", str(supervisor.state))
        return Command("hold", reason)
