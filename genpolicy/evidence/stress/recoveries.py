"""Each entry into recovery as a row: why it began, what it did, and what followed.

A recovery is more than another sample. It counts where its own primitive commanded the arm to
its goal, the policy took over from there and the episode succeeded; not where the same phase had
to be recovered again, where a person was called, or where new samples alone had helped.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION
from genpolicy.evidence.rows.stress import RecoveryRow
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.shard import Shard
from genpolicy.evidence.stress.state import Outcome
from genpolicy.execution.cell import PRIMITIVES, RecoveryState
from genpolicy.execution.journal import Event, decode_actions
from genpolicy.execution.nanoseconds import NS_PER_S

HANDED_BACK, EPISODE_OVER = "handed_back", "episode_over"
ENDS = {
    RecoveryState.IDLE: HANDED_BACK,
    RecoveryState.ASK_HUMAN: "person",
    RecoveryState.STOPPED: "stopped",
}
TIMED_OUT, REFUSED = "timed_out", "refused"
"""How an abort is told: the last primitive took too long, or could not be executed."""


LEAST_M, LEAST_TURN = 1e-3, 0.01
"""What a primitive must command away from the held pose to have moved anything: of the position or
the gripper's opening, m, or of the two columns of the rotation, about rad."""


def is_a_motion(held: str, action: str) -> bool:
    """Whether an action, as journals write it, lies away from the held one."""
    (away,) = decode_actions(action) - decode_actions(held)
    if abs(away[GRIPPER]) >= LEAST_M or math.hypot(*away[POSITION]) >= LEAST_M:
        return True
    return math.hypot(*away[ROTATION]) >= LEAST_TURN


@dataclass
class Entry:
    """One entry into recovery while events go by; times in ns."""

    begun_ns: int
    phase: str
    cause: str
    held: str
    failures_before: int
    failures: int = 0
    primitives: list[str] = field(default_factory=list)
    moved: bool = False
    force_peak_n: float = 0.0
    ended: str = EPISODE_OVER
    ended_ns: int | None = None
    taken_over: bool = False

    def to(self, state: RecoveryState, event: Event) -> None:
        """The machine goes on to another state."""
        self.failures = event.payload["failures"] - self.failures_before
        if state in PRIMITIVES:
            self.primitives.append(str(state))
        elif state is RecoveryState.ABORT:
            self.ended = TIMED_OUT if event.payload["cause"] == "timeout" else REFUSED
            self.ended_ns = event.t
        elif state in ENDS:
            self.ended, self.ended_ns = ENDS[state], event.t

    @property
    def resampled_only(self) -> bool:
        """Whether nothing but new samples can have helped."""
        return self.ended == HANDED_BACK and not self.moved


def entries_of(events: Iterable[Event]) -> list[Entry]:
    """Every entry into recovery of a session, in order."""
    entries: list[Entry] = []
    commanded, failures, last_ns = "", 0, 0
    for event in events:
        kind, payload = event.kind, event.payload
        last_ns = event.t
        entry = entries[-1] if entries else None
        running = entry is not None and entry.ended_ns is None
        if kind == "recovery":
            if (payload["old"], payload["new"]) == (RecoveryState.IDLE, RecoveryState.HOLD):
                begun = (payload["phase"], payload["cause"], commanded, failures)
                entries.append(Entry(event.t, *begun))
            elif entry is not None and running:
                entry.to(RecoveryState(payload["new"]), event)
            failures = payload["failures"]
        elif kind in ("accept", "fallback"):
            if entry is not None:
                # Before the first command nobody knows what was held; the first row is it then.
                # What moves is a primitive's own, and nothing of the policy.
                if running and kind == "fallback" and entry.primitives:
                    entry.held = entry.held or payload["action"]
                    entry.moved |= is_a_motion(entry.held, payload["action"])
                entry.taken_over |= kind == "accept" and entry.ended == HANDED_BACK
            commanded = payload["action"]
        elif kind == "recovery_force" and entry is not None and running:
            entry.force_peak_n = max(entry.force_peak_n, payload["force_n"])
    for entry in entries:
        entry.ended_ns = last_ns if entry.ended_ns is None else entry.ended_ns
    return entries


def recovery_rows(shard: Shard, rollout: Rollout) -> list[RecoveryRow]:
    """Rows of `recoveries.parquet` of one rollout that has ended, in the order of entry."""
    entries = entries_of(rollout.journal.events())
    succeeded = rollout.outcome is Outcome.SUCCESS
    rows = []
    for number, entry in enumerate(entries):
        assert entry.ended_ns is not None
        again = any(later.phase == entry.phase for later in entries[number + 1 :])
        helped = entry.ended == HANDED_BACK and not entry.resampled_only and entry.taken_over
        rows.append(
            RecoveryRow(
                method=shard.judged.name,
                seed=shard.judged.seed,
                perturbation=shard.perturbation,
                start=rollout.start_index,
                recovery=number,
                phase=entry.phase,
                cause=entry.cause,
                primitives=" ".join(entry.primitives),
                failures=entry.failures,
                ended=entry.ended,
                resampled_only=entry.resampled_only,
                taken_over=entry.taken_over,
                succeeded=succeeded,
                recovered=helped and succeeded and not again,
                duration_s=(entry.ended_ns - entry.begun_ns) / NS_PER_S,
                force_peak_n=entry.force_peak_n,
                resets=int(entry.ended == ENDS[RecoveryState.STOPPED]),
            )
        )
    return rows
