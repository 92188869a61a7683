"""Conservation, derived again: every arrival and every action ends exactly once."""

from collections import Counter
from collections.abc import Iterator
from typing import Any

from genpolicy.contract.chunk import DiscardReason

REASONS = frozenset(DiscardReason) | {"late", "beyond_execution_horizon"}


class Balance:
    """Chunks and actions of one session."""

    def __init__(self) -> None:
        self.generated_chunks = self.executed_chunks = 0
        self.generated_actions = self.executed_actions = 0
        self.discarded_chunks: Counter[str] = Counter()
        self.lost_actions: Counter[str] = Counter()
        self.rows: dict[int, int] = {}
        self.accepted: Counter[int] = Counter()

    def arrived(self, arrival: int, rows: int) -> Iterator[str]:
        """A chunk enters."""
        if arrival != self.generated_chunks:
            yield f"Arrival {arrival} is number {self.generated_chunks}."
        self.generated_chunks += 1
        self.generated_actions += rows
        self.rows[arrival] = rows

    def refused(self, arrival: int, rows: dict[str, int], reason: str) -> Iterator[str]:
        """A chunk is discarded without entering."""
        yield from self.arrived(arrival, sum(rows.values()))
        yield from self.closed(arrival, rows, "discarded", reason)

    def executed(self, arrival: int) -> None:
        """One action of it was accepted."""
        self.accepted[arrival] += 1
        self.executed_actions += 1

    def closed(self, arrival: int, rows: dict[str, int], ended: str, reason: Any) -> Iterator[str]:
        """A chunk ends, with where its actions went."""
        expected = self.rows.pop(arrival)
        lost = {key: count for key, count in rows.items() if key != "executed"}
        if sum(rows.values()) != expected or any(count < 0 for count in rows.values()):
            yield f"Arrival {arrival} had {expected} actions, {rows} are accounted for."
        if rows["executed"] != self.accepted[arrival]:
            yield f"Arrival {arrival}: {self.accepted[arrival]} accepted, {rows['executed']} noted."
        if (ended == "executed") != (self.accepted[arrival] > 0):
            yield f"Arrival {arrival} ended as {ended}, {self.accepted[arrival]} were accepted."
        unknown = set(lost) - REASONS
        if unknown or ((ended == "discarded" or reason is not None) and reason not in REASONS):
            yield f"Arrival {arrival} was lost for {sorted(unknown) or reason}, no known reason."
        self.lost_actions.update(lost)
        if ended == "executed":
            self.executed_chunks += 1
        else:
            self.discarded_chunks[str(reason)] += 1

    def check_end(self, m: dict[str, Any], events: int) -> Iterator[str]:
        """The session's own totals against these."""
        own = {
            "chunks": (self.generated_chunks, self.executed_chunks, self.discarded_chunks,
                       len(self.rows)),
            "actions": (self.generated_actions, self.executed_actions, self.lost_actions,
                        sum(n - self.accepted[a] for a, n in self.rows.items())),
        }  # fmt: skip
        for name, (generated, executed, discarded, queued) in own.items():
            nonzero = {key: count for key, count in sorted(discarded.items()) if count}
            claimed = m[name]
            claimed_nonzero = {k: v for k, v in claimed["discarded"].items() if v}
            same = (
                claimed["generated"] == generated
                and claimed["executed"] == executed
                and claimed["queued"] == queued
                and claimed_nonzero == nonzero
            )
            if not same:
                yield f"The session claims {claimed} for {name}; counted: {own[name]}."
            if generated != executed + sum(discarded.values()) + queued:
                yield f"{name}: {generated} generated, {own[name][1:]} accounted for."
        if m["events"] != events:
            yield f"The session claims {m['events']} events before its end, {events} were read."
