"""The queue of admitted chunks: what is in it, what leaves it and why, all of it journaled."""

from typing import TYPE_CHECKING

from genpolicy.contract.chunk import DiscardReason
from genpolicy.execution.checks import Checks, Place, refusal
from genpolicy.execution.continuity import Continuity
from genpolicy.execution.journal import Journal, encode_actions, encode_poses
from genpolicy.execution.ledger import BEYOND_HORIZON, Conservation, Ledger, QueuedChunk
from genpolicy.execution.moment import Chunk, Moment, View
from genpolicy.execution.nanoseconds import to_ns

if TYPE_CHECKING:
    from genpolicy.feasibility.admission import Admitted

Payload = dict[str, object]

LOST_AS = {"execution_horizon": BEYOND_HORIZON}
"""Rows that were never to be executed are no discarded ones; the ledger has its own word."""


class ChunkQueue:
    """Admitted chunks in the order of their arrival.

    Args:
        capacity: Chunks kept; the oldest is dropped beyond it.
        journal: Where what enters and leaves goes.
        checks: The table.

    Attributes:
        head: Chunk that the next one must name as predecessor; None after a break of the chain.
        last_accepted: Chunk of the last action that the controller accepted, in this session.
        last_due_ns: Begin of that action's window.
        continuity: What was commanded last.
    """

    def __init__(self, capacity: int, journal: Journal, checks: Checks) -> None:
        self.head: str | None = None
        self.last_accepted: QueuedChunk | None = None
        self.last_due_ns: int | None = None
        self.continuity = Continuity()
        self._capacity = capacity
        self._journal = journal
        self._checks = checks
        self._chunks: list[QueuedChunk] = []
        self._ledger = Ledger()

    @property
    def arrivals(self) -> int:
        """Number of arrivals so far."""
        return self._ledger.generated_chunks

    def arrive(self, rows: int) -> int:
        """Count an arrival of K actions. Returns its number."""
        return self._ledger.arrive(rows)

    def refuse(self, now_ns: int, *, arrival: int, chunk_id: str, rows: int, reason: str) -> None:
        """Account for an arrival that does not enter the queue."""
        self._ledger.refuse(rows, reason)
        lost = {"executed": 0, reason: rows}
        payload: Payload = {
            "arrival": arrival, "chunk_id": chunk_id, "ended": "discarded", "rows": lost,
            "at": "arrival", "reason": reason,
        }  # fmt: skip
        self._journal.add("discard", now_ns, payload)

    def arrival_refusal(self, now_ns: int, about: Chunk, view: View) -> DiscardReason | None:
        """Why a chunk may not enter the queue; None if it may."""
        accepted = self.last_accepted.about.times if self.last_accepted is not None else None
        waiting = [chunk.about.times for chunk in self._chunks]
        moment = Moment(
            now_ns=now_ns,
            view=view,
            about=about,
            first_use_ns=max(now_ns, about.times.start_ns),
            row=min(about.rows, view.execution_horizon) - 1,
            head=self.head,
            accepted_condition_ns=None if accepted is None else accepted.condition_ns,
            accepted_start_ns=None if accepted is None else accepted.start_ns,
            queued_condition_ns=max((times.condition_ns for times in waiting), default=None),
            queued_start_ns=max((times.start_ns for times in waiting), default=None),
        )
        check = refusal(self._checks, Place.ARRIVAL, moment)
        return None if check is None else check.reason

    def enqueue(self, now_ns: int, admitted: "Admitted", about: Chunk, view: View) -> None:
        """Add a chunk; older ones lose their actions from its start on, and their place if full."""
        chunk = QueuedChunk(admitted, about)
        self._trim(now_ns, chunk, view, newer_start_ns=None)
        for old in list(self._chunks):
            self._trim(now_ns, old, view, newer_start_ns=about.times.start_ns)
            if old.open_rows == 0:
                self.close(now_ns, old, DiscardReason.SUPERSEDED)
        while self._chunks and (reason := self._no_room(now_ns)) is not None:
            self.close(now_ns, self._chunks[0], reason)
        self._journal.add("enqueue", now_ns, _enqueue_payload(chunk))
        self._chunks.append(chunk)
        self.head = chunk.chunk_id

    def _no_room(self, now_ns: int) -> DiscardReason | None:
        """Why the oldest chunk must leave before another enters; None if there is room."""
        moment = Moment(now_ns=now_ns, waiting=len(self._chunks), capacity=self._capacity)
        check = refusal(self._checks, Place.ROOM, moment)
        return None if check is None else check.reason

    def remaining(self, now_ns: int) -> int:
        """Actions that can still be executed."""
        return sum(
            max(0, chunk.end_row - max(chunk.next_row, chunk.row_at(now_ns)))
            for chunk in self._chunks
        )

    def sweep(self, now_ns: int, view: View) -> None:
        """Close what is stale, void or past; before any action is chosen."""
        for chunk in list(self._chunks):
            check = self._ask(Place.QUEUE, now_ns, chunk, view)
            if check is not None:
                self.close(now_ns, chunk, check)
                continue
            while chunk.open_rows and self._ask(Place.PAST, now_ns, chunk, view):
                chunk.skip()
            if chunk.open_rows == 0:
                self.close(now_ns, chunk, None)

    def due(self, now_ns: int, view: View) -> QueuedChunk | None:
        """The chunk whose next row is the command of this moment."""
        newer_start_ns: int | None = None
        found = None
        for chunk in reversed(self._chunks):
            if self._ask(Place.DUE, now_ns, chunk, view, newer_start_ns) is None:
                found = chunk
            start_ns = chunk.about.times.start_ns
            newer_start_ns = start_ns if newer_start_ns is None else min(newer_start_ns, start_ns)
        return found

    def continues(self, now_ns: int, chunk: QueuedChunk, view: View) -> DiscardReason | None:
        """Why the chunk's next row, which is due, may not follow the last command; None if so."""
        return self._ask(Place.NEXT, now_ns, chunk, view)

    def accepted(self, now_ns: int, chunk: QueuedChunk) -> None:
        """The controller accepted the chunk's next row."""
        row, admitted = chunk.next_row, chunk.admitted
        self.continuity.note(now_ns, admitted, row, admitted.actions[row])
        self.last_accepted = chunk
        self.last_due_ns = chunk.about.times.due_ns(chunk.next_row)
        chunk.take()
        if chunk.open_rows == 0:
            self.close(now_ns, chunk, None)

    def drop(self, now_ns: int, view: View, reason: DiscardReason) -> None:
        """After an event: discard what the checks with this reason refuse now."""
        checks = tuple(check for check in self._checks if check.reason is reason)
        for chunk in list(self._chunks):
            moment = Moment(now_ns=now_ns, view=view, about=chunk.about)
            if refusal(checks, Place.QUEUE, moment) is not None:
                self.close(now_ns, chunk, reason)

    def _ask(
        self,
        place: Place,
        now_ns: int,
        chunk: QueuedChunk,
        view: View,
        newer_start_ns: int | None = None,
    ) -> DiscardReason | None:
        moment = Moment(
            now_ns=now_ns, view=view, about=chunk.about, row=chunk.next_row,
            newer_start_ns=newer_start_ns, last_due_ns=self.last_due_ns,
            last_accept_ns=self.continuity.given_ns,
            follows=self.continuity.follows(
                chunk.admitted, chunk.about, chunk.next_row, now_ns, view
            ),
        )  # fmt: skip
        check = refusal(self._checks, place, moment)
        return None if check is None else check.reason

    def _trim(
        self, now_ns: int, chunk: QueuedChunk, view: View, *, newer_start_ns: int | None
    ) -> None:
        """Take away rows that will never be executed: from the end, then from the front."""

        def refused(row: int) -> str | None:
            moment = Moment(
                now_ns=now_ns, view=view, about=chunk.about, row=row, newer_start_ns=newer_start_ns
            )
            check = refusal(self._checks, Place.ROWS, moment)
            return None if check is None else LOST_AS.get(check.name, str(check.reason))

        while chunk.open_rows and (reason := refused(chunk.end_row - 1)) is not None:
            chunk.cut_at(chunk.end_row - 1, reason)
        while chunk.open_rows and refused(chunk.next_row) is not None:
            chunk.skip()

    def close(
        self, now_ns: int, chunk: QueuedChunk, reason: DiscardReason | None, at: str = "queue"
    ) -> None:
        """A chunk ends; without a reason because its time ran out."""
        if reason is not None:
            chunk.cut_at(chunk.next_row, reason)
        self._chunks.remove(chunk)
        ended = self._ledger.close(chunk, reason)
        if reason is None and ended == "discarded":
            reason = DiscardReason.EXPIRED
        displaced = (DiscardReason.SUPERSEDED, DiscardReason.QUEUE_OVERFLOW)
        keeps_chain = reason is None or reason in displaced
        if self.head == chunk.chunk_id and not keeps_chain:
            self.head = None
        payload: Payload = {
            "arrival": chunk.about.arrival, "chunk_id": chunk.chunk_id, "ended": ended,
            "rows": chunk.row_counts(),
        }  # fmt: skip
        if reason is None:
            self._journal.add("finish", now_ns, payload)
        else:
            self._journal.add("discard", now_ns, {**payload, "at": at, "reason": str(reason)})

    def forget(self) -> None:
        """A new session: no chain, no last action."""
        self.head = self.last_accepted = self.last_due_ns = None
        self.continuity.forget()

    def conservation(self) -> Conservation:
        """The balances now."""
        return self._ledger.conservation(self._chunks)


def _enqueue_payload(chunk: QueuedChunk) -> Payload:
    admitted, about = chunk.admitted, chunk.about
    metadata, times = about.metadata, about.times
    return {
        "arrival": about.arrival, "chunk_id": chunk.chunk_id, "source": about.source,
        "method": metadata.method, "condition_ns": times.condition_ns,
        "start_ns": times.start_ns, "period_ns": times.period_ns,
        "valid_until_ns": times.valid_until_ns, "phase": metadata.task_phase,
        "calibration_epoch": metadata.calibration_epoch,
        "checkpoint": metadata.policy_checkpoint_hash, "sampler": metadata.sampler_config_hash,
        "session_epoch": metadata.session_epoch, "predecessor": metadata.predecessor_chunk_id,
        "rows": about.rows, "raw": _raw(admitted), "actions": encode_actions(admitted.actions),
        "actions_sha256": admitted.actions_sha256,
        "checked_rows": list(admitted.verdict.rows),
        "layers": {layer.name: bool(layer.passed) for layer in admitted.verdict.layers},
        "motion": _motion(admitted),
    }  # fmt: skip


def _motion(admitted: "Admitted") -> Payload | None:
    """What the chunk was checked against, so that it can be proved again; None if imitated."""
    context = getattr(admitted, "context", None)
    q_rad = getattr(admitted.verdict, "q_rad", None)
    if context is None or q_rad is None:
        return None
    return {
        "joints": q_rad.shape[1],
        "q_rad": encode_actions(q_rad),
        "q_cmd_rad": encode_actions(context.q_cmd),
        "q_before_rad": encode_actions(context.q_cmd_history),
        "q_meas_rad": encode_actions(context.q_meas),
        "dq_meas_rad_s": None if context.dq_meas is None else encode_actions(context.dq_meas),
        "measured_ns": to_ns(context.measured_at_s),
        "last_action": encode_actions(context.last_action),
        "scene": encode_poses(context.scene.bodies),
    }


def _raw(admitted: "Admitted") -> str:
    """The actions as drawn, where projection changed a bit of them; else empty."""
    raw = encode_actions(admitted.drawn)
    return "" if raw == encode_actions(admitted.actions) else raw
