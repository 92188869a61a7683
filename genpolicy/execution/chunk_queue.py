"""The queue of admitted chunks: what is in it, what leaves it and why, all of it journaled."""

from typing import TYPE_CHECKING

from genpolicy.contract.chunk import DiscardReason
from genpolicy.execution.freshness import Situation, time_refusal
from genpolicy.execution.journal import Journal, encode_actions
from genpolicy.execution.ledger import ChunkTimes, Conservation, Ledger, QueuedChunk
from genpolicy.execution.settings import ExecutorSettings

if TYPE_CHECKING:
    from genpolicy.feasibility.admission import Admitted

Payload = dict[str, object]


class ChunkQueue:
    """Admitted chunks in the order of their arrival.

    Attributes:
        head: Chunk that the next one must name as predecessor; None after a break of the chain.
        last_accepted: Chunk of the last action that the controller accepted, in this session.
        last_due_ns: Begin of that action's window.
    """

    def __init__(
        self, settings: ExecutorSettings, journal: Journal, disabled: frozenset[str]
    ) -> None:
        self.head: str | None = None
        self.last_accepted: QueuedChunk | None = None
        self.last_due_ns: int | None = None
        self._settings = settings
        self._maximum_age_ns = settings.maximum_age_ns
        self._journal = journal
        self._disabled = disabled
        self._chunks: list[QueuedChunk] = []
        self._ledger = Ledger()

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

    def enqueue(
        self, now_ns: int, admitted: "Admitted", *, arrival: int, times: ChunkTimes, source: str
    ) -> None:
        """Add a chunk; older ones lose their actions from its start on, and their place if full."""
        rows = len(admitted.actions)
        end_row = rows
        if "execution_horizon" not in self._disabled:
            end_row = min(end_row, self._settings.execution_horizon)
        chunk = QueuedChunk(admitted, source, arrival, times, rows, end_row)
        if "checked_rows" not in self._disabled:
            first, last = admitted.verdict.rows
            chunk.cut_at(last, DiscardReason.INFEASIBLE)
            chunk.skip_to(first)
        if "superseded" not in self._disabled:
            for old in list(self._chunks):
                started = times.start_ns <= now_ns
                row = 0 if started else old.first_row_due_from(times.start_ns)
                old.cut_at(row, DiscardReason.SUPERSEDED)
                if old.open_rows == 0:
                    self.close(now_ns, old, DiscardReason.SUPERSEDED)
        while len(self._chunks) >= self._settings.queue_capacity:
            self.close(now_ns, self._chunks[0], DiscardReason.QUEUE_OVERFLOW)
        self._journal.add("enqueue", now_ns, _enqueue_payload(chunk))
        self._chunks.append(chunk)
        self.head = chunk.chunk_id

    def order_refusal(self, times: ChunkTimes, predecessor: str) -> DiscardReason | None:
        """Behind a newer chunk, or not the continuation of the last one."""
        if "out_of_order" not in self._disabled:
            last = self.last_accepted
            if last is not None and _older(times, last.times):
                return DiscardReason.SUPERSEDED
            if any(_older(times, chunk.times) for chunk in self._chunks):
                return DiscardReason.OUT_OF_ORDER
        if predecessor not in ("", self.head) and "predecessor" not in self._disabled:
            return DiscardReason.BROKEN_PREDECESSOR
        return None

    def remaining(self, now_ns: int) -> int:
        """Actions that can still be executed."""
        return sum(
            max(0, chunk.end_row - max(chunk.next_row, chunk.row_at(now_ns)))
            for chunk in self._chunks
        )

    def sweep(self, now_ns: int, situation: Situation) -> None:
        """Close what is stale, void or past; before any action is chosen."""
        for chunk in list(self._chunks):
            reason = time_refusal(
                chunk.times,
                situation,
                now_ns=now_ns,
                first_use_ns=now_ns,
                maximum_age_ns=self._maximum_age_ns,
                disabled=self._disabled,
            )
            if reason is not None:
                self.close(now_ns, chunk, reason)
                continue
            if "window" not in self._disabled:
                chunk.skip_to(chunk.row_at(now_ns))
            if chunk.open_rows == 0:
                self.close(now_ns, chunk, None)

    def due(self, now_ns: int) -> QueuedChunk | None:
        """The newest started chunk, if its next row is due now and was not yet sent."""
        oldest_first = "superseded" in self._disabled
        for chunk in self._chunks if oldest_first else reversed(self._chunks):
            row = chunk.row_at(now_ns)
            if row < 0:
                continue
            if row < chunk.next_row:
                return None
            due_ns = chunk.due_ns(chunk.next_row)
            again = self.last_due_ns is not None and due_ns <= self.last_due_ns
            return None if again and "out_of_order" not in self._disabled else chunk
        return None

    def took(self, now_ns: int, chunk: QueuedChunk) -> None:
        """The controller accepted the chunk's next row."""
        self.last_accepted, self.last_due_ns = chunk, chunk.due_ns(chunk.next_row)
        chunk.take()
        if chunk.open_rows == 0:
            self.close(now_ns, chunk, None)

    def drop(
        self, now_ns: int, reason: DiscardReason, check: str, source: str | None = None
    ) -> None:
        """Discard everything that is queued (of one source), unless `check` is disabled."""
        if check in self._disabled:
            return
        for chunk in list(self._chunks):
            if source in (None, chunk.source):
                self.close(now_ns, chunk, reason)

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
            "arrival": chunk.arrival, "chunk_id": chunk.chunk_id, "ended": ended,
            "rows": chunk.row_counts(),
        }  # fmt: skip
        if reason is None:
            self._journal.add("finish", now_ns, payload)
        else:
            self._journal.add("discard", now_ns, {**payload, "at": at, "reason": str(reason)})

    def forget(self) -> None:
        """A new session: no chain, no last action."""
        self.head = self.last_accepted = self.last_due_ns = None

    def conservation(self) -> Conservation:
        """The balances now."""
        return self._ledger.conservation(self._chunks)


def _older(times: ChunkTimes, than: ChunkTimes) -> bool:
    return times.condition_ns < than.condition_ns or times.start_ns < than.start_ns


def _enqueue_payload(chunk: QueuedChunk) -> Payload:
    metadata, times, admitted = chunk.admitted.metadata, chunk.times, chunk.admitted
    return {
        "arrival": chunk.arrival, "chunk_id": chunk.chunk_id, "source": chunk.source,
        "method": metadata.method, "condition_ns": times.condition_ns,
        "start_ns": times.start_ns, "period_ns": times.period_ns,
        "valid_until_ns": times.valid_until_ns, "phase": metadata.task_phase,
        "calibration_epoch": metadata.calibration_epoch,
        "checkpoint": metadata.policy_checkpoint_hash, "sampler": metadata.sampler_config_hash,
        "session_epoch": metadata.session_epoch, "predecessor": metadata.predecessor_chunk_id,
        "rows": chunk.rows, "actions": encode_actions(admitted.actions),
        "actions_sha256": admitted.actions_sha256,
        "checked_rows": list(admitted.verdict.rows),
        "layers": {layer.name: bool(layer.passed) for layer in admitted.verdict.layers},
    }  # fmt: skip
