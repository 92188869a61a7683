"""Chunks in the queue, and the ledger that accounts for every chunk and every action.

Counted are arrivals: each call of `deliver` or `write_off` is one generated chunk with K generated
actions, a duplicate included. A chunk ends exactly once: `executed` if the controller accepted at
least one of its actions, otherwise discarded with one reason. An action ends exactly once: it was
executed, or it was lost for the reason that dropped it, because its window had passed (`late`), or
because it lies beyond the execution horizon. What has not ended is queued.
"""

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from genpolicy.execution.moment import Chunk

if TYPE_CHECKING:
    from genpolicy.feasibility.admission import Admitted

LATE = "late"
BEYOND_HORIZON = "beyond_execution_horizon"


@dataclass(frozen=True)
class Account:
    """One balance; `error` is 0 when nothing was lost or counted twice."""

    generated: int
    executed: int
    discarded: dict[str, int]
    queued: int

    @property
    def error(self) -> int:
        """Generated minus everything accounted for."""
        return self.generated - self.executed - sum(self.discarded.values()) - self.queued

    def as_dict(self) -> dict[str, object]:
        """The four terms, reasons sorted."""
        return {
            "generated": self.generated,
            "executed": self.executed,
            "discarded": dict(sorted(self.discarded.items())),
            "queued": self.queued,
        }


@dataclass(frozen=True)
class Conservation:
    """`generated = executed + discarded by reason + still queued`, for chunks and for actions.

    Attributes:
        chunks: Balance of chunks.
        actions: Balance of actions.
        rest_discarded: Chunks that count as executed but lost their rest, by reason.
    """

    chunks: Account
    actions: Account
    rest_discarded: dict[str, int]

    def as_dict(self) -> dict[str, object]:
        """Both balances, for the journal."""
        return {"chunks": self.chunks.as_dict(), "actions": self.actions.as_dict()}

    @property
    def error(self) -> int:
        """Sum of the two absolute errors; 0 when both balances close."""
        return abs(self.chunks.error) + abs(self.actions.error)


@dataclass(slots=True)
class QueuedChunk:
    """An enqueued chunk: `next_row` is the first action not yet decided, `end_row` the limit."""

    admitted: "Admitted"
    about: Chunk
    end_row: int = field(init=False)
    next_row: int = 0
    executed: int = 0
    lost: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.end_row = self.about.rows

    @property
    def chunk_id(self) -> str:
        """Name of the chunk."""
        return self.about.metadata.chunk_id

    @property
    def open_rows(self) -> int:
        """Actions that are still queued."""
        return self.end_row - self.next_row

    def row_at(self, now_ns: int) -> int:
        """Row that is due now; negative before the start."""
        return (now_ns - self.about.times.start_ns) // self.about.times.period_ns

    def skip(self) -> None:
        """Count the next row as late."""
        self.lost[LATE] += 1
        self.next_row += 1

    def cut_at(self, row: int, reason: str) -> None:
        """Drop the rows from `row` on."""
        limit = min(max(row, self.next_row), self.end_row)
        if limit < self.end_row:
            self.lost[str(reason)] += self.end_row - limit
            self.end_row = limit

    def take(self) -> None:
        """The controller accepted `next_row`."""
        self.executed += 1
        self.next_row += 1

    def row_counts(self) -> dict[str, int]:
        """Where its actions went; sums to K when nothing is open."""
        return {"executed": self.executed, **dict(sorted(self.lost.items()))}


class Ledger:
    """Running totals of one session."""

    def __init__(self) -> None:
        self.generated_chunks = 0
        self.generated_actions = 0
        self.executed_chunks = 0
        self.executed_actions = 0
        self.discarded_chunks: Counter[str] = Counter()
        self.lost_actions: Counter[str] = Counter()
        self.rest_discarded: Counter[str] = Counter()

    def arrive(self, rows: int) -> int:
        """Count an arrival of K actions. Returns its number, from 0."""
        self.generated_chunks += 1
        self.generated_actions += rows
        return self.generated_chunks - 1

    def refuse(self, rows: int, reason: str) -> None:
        """An arrival that never entered the queue."""
        self.discarded_chunks[reason] += 1
        self.lost_actions[reason] += rows

    def close(self, chunk: QueuedChunk, reason: str | None) -> str:
        """A queued chunk ends; `reason` is None when its time ran out. Returns how it ended."""
        self.executed_actions += chunk.executed
        self.lost_actions.update(chunk.lost)
        if chunk.executed:
            self.executed_chunks += 1
            if reason is not None:
                self.rest_discarded[str(reason)] += 1
            return "executed"
        self.discarded_chunks[str(reason or "expired")] += 1
        return "discarded"

    def conservation(self, queue: list[QueuedChunk]) -> Conservation:
        """The balances, with `queue` as what is still open."""
        lost = Counter(self.lost_actions)
        for chunk in queue:
            lost.update(chunk.lost)
        chunks = Account(
            self.generated_chunks, self.executed_chunks, dict(self.discarded_chunks), len(queue)
        )
        actions = Account(
            self.generated_actions,
            self.executed_actions + sum(chunk.executed for chunk in queue),
            dict(lost),
            sum(chunk.open_rows for chunk in queue),
        )
        return Conservation(chunks, actions, dict(self.rest_discarded))
