"""What claims to be an admitted chunk is read here; nothing is asked of what cannot be read."""

from typing import TYPE_CHECKING

import numpy as np

from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.chunk import ChunkMetadata, DiscardReason, actions_sha256
from genpolicy.execution.checks import Checks, Place, refusal
from genpolicy.execution.chunk_queue import ChunkQueue
from genpolicy.execution.issued import issued_by_feasibility
from genpolicy.execution.moment import MODE_OF_SOURCE, Chunk, Moment, View
from genpolicy.execution.nanoseconds import ChunkTimes, to_ns
from genpolicy.execution.scene import read_scene

if TYPE_CHECKING:
    from genpolicy.feasibility.admission import Admitted

LAYER_COUNT = 6
MALFORMED = "<malformed>"


def shape_of(admitted: "Admitted") -> tuple[int, str]:
    """Number of rows and name of whatever was delivered, malformed things included."""
    try:
        actions, metadata = admitted.actions, admitted.metadata
    except Exception:  # of whatever it is, reading it may raise anything
        return 0, MALFORMED
    rows = len(actions) if type(actions) is np.ndarray and actions.ndim == 2 else 0
    return rows, named_in(metadata)


def named_in(metadata: object) -> str:
    """Name of the chunk that metadata are of, malformed things included."""
    # One that nobody has built to its end has no fields at all.
    named = getattr(metadata, "chunk_id", None) if type(metadata) is ChunkMetadata else None
    return named if type(named) is str else MALFORMED


def read_chunk(admitted: "Admitted", *, arrival: int, source: str) -> Chunk | None:
    """What the table of checks asks about; None where shape, times, names or rows are not."""
    if shape_of(admitted)[1] == MALFORMED or source not in MODE_OF_SOURCE:
        return None
    try:
        times = ChunkTimes.of(admitted.metadata)
        actions, layers = admitted.actions, admitted.verdict.layers
        passed = len(layers) == LAYER_COUNT and all(layer.passed is True for layer in layers)
        first, last = admitted.verdict.rows
        shaped = actions.ndim == 2 and actions.shape[1] == ACTION_DIM and len(actions) > 0
        checked = 0 <= first < last <= len(actions)
        if not (shaped and checked and times.period_ns > 0 and admitted.metadata.well_typed):
            return None
        return Chunk(
            metadata=admitted.metadata,
            times=times,
            source=source,
            arrival=arrival,
            rows=len(actions),
            checked_rows=(first, last),
            passed=passed and bool(np.isfinite(actions).all()),
            hashed=actions_sha256(actions) == admitted.actions_sha256,
            scene=read_scene(admitted.context.scene.bodies),
            measured_ns=to_ns(admitted.context.measured_at_s),
        )
    except Exception:  # of whatever it is, reading it may raise anything
        return None


class Arrivals:
    """Everything that arrives is counted, and enters the queue or is discarded for one reason.

    Args:
        queue: Where it goes.
        checks: The table.
    """

    def __init__(self, queue: ChunkQueue, checks: Checks) -> None:
        self._queue = queue
        self._checks = checks
        self._names: set[str] = set()

    def arrive(
        self, admitted: "Admitted", now_ns: int, view: View, source: str
    ) -> DiscardReason | None:
        """Enqueue a chunk of this source, or discard it and say why."""
        rows, name = shape_of(admitted)
        arrival = self._queue.arrive(rows)
        known, issued = name in self._names, issued_by_feasibility(admitted)
        moment = Moment(now_ns=now_ns, view=view, known=known, issued=issued)
        at_door = refusal(self._checks, Place.DOOR, moment)
        about = None
        if at_door is None:  # what is turned away must not use up the name of a chunk to come
            self._names.add(name)
            about = read_chunk(admitted, arrival=arrival, source=source)
        if at_door is not None:
            reason = at_door.reason
        elif about is None:
            reason = DiscardReason.INFEASIBLE
        else:
            reason = self._queue.arrival_refusal(now_ns, about, view)
            if reason is None:
                self._queue.enqueue(now_ns, admitted, about, view)
                return None
        self._queue.refuse(now_ns, arrival=arrival, chunk_id=name, rows=rows, reason=str(reason))
        return reason

    def write_off(
        self, now_ns: int, metadata: ChunkMetadata, rows: int, reason: DiscardReason
    ) -> None:
        """Account for a chunk that never became deliverable; twice is a duplicate."""
        name = named_in(metadata)
        if type(rows) is not int or rows < 0:
            rows = 0
        if type(reason) is not DiscardReason:
            reason = DiscardReason.INFEASIBLE
        if name != MALFORMED:  # it names no chunk, so that another one like it is no duplicate
            if name in self._names:
                reason = DiscardReason.DUPLICATE
            self._names.add(name)
        arrival = self._queue.arrive(rows)
        self._queue.refuse(now_ns, arrival=arrival, chunk_id=name, rows=rows, reason=str(reason))
