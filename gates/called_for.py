"""Why recovery began and went where it needs somebody, as the plan of a ladder has it.

A call ends a rollout where nobody is planned, and what ends a rollout must not be a word. Recovery
begins where nothing was commanded for long enough or an answer was late in a phase that falls back
then, it holds before it asks, and it asks or gives up where nothing else is left.
"""

from collections.abc import Iterator

from gates.played_again import Recorded, Turn
from genpolicy.contract.latency import DeadlineAction
from genpolicy.execution.cell import PRIMITIVES, ExecutionSettings, LateChunk, RecoveryState
from genpolicy.execution.nanoseconds import to_ns

ROUNDING_NS = 1_000
SILENCE, LATE, OVERRUN, DRILL = "silence", "late chunk", "overrun of ", "drill"
"""Causes that recovery begins for. Whether a drill was planned is asked of the plan of its
condition (`rederive_disturbance`)."""
IDLE, HOLD = RecoveryState.IDLE, RecoveryState.HOLD
ASKED, ABORTED = RecoveryState.ASK_HUMAN, RecoveryState.ABORT


def uncalled_for(recorded: Recorded, execution: ExecutionSettings) -> Iterator[tuple[int, str]]:
    """What recovery did without the reason that the plan asks for: when, ns, and what it was.

    Args:
        recorded: A rollout.
        execution: When recovery begins, how long it holds and waits, how often it tries.
    """
    since_ns = attempts = 0
    phase = ""
    for turn in recorded.turns:
        waited_ns = turn.t - since_ns + ROUNDING_NS
        if (turn.old, turn.new) == (IDLE, HOLD):
            attempts, phase = attempts + 1, turn.phase
            if not _provoked(turn, recorded, execution):
                yield turn.t, f"recovery begins for {turn.cause!r}"
        elif turn.old == HOLD and turn.new in (*PRIMITIVES, ASKED):
            if waited_ns < to_ns(execution.recovery_hold_s):
                yield turn.t, f"recovery holds no longer and goes to {turn.new!r}"
            planned = execution.recovery_plans.get(phase, ())
            if turn.new == ASKED and planned and attempts <= execution.maximum_failures:
                yield turn.t, f"a person is asked behind attempt {attempts} in {phase!r}"
        elif turn.new == ABORTED:
            waits = turn.old == ASKED and waited_ns < to_ns(execution.human_timeout_s)
            tries = turn.old in PRIMITIVES and turn.failures < execution.maximum_failures
            if waits or tries:
                yield turn.t, f"recovery gives up in {turn.old!r} behind {turn.failures} failures"
        if turn.new == IDLE and turn.old in (ABORTED, RecoveryState.STOPPED):
            attempts = 0
        since_ns = turn.t


def _provoked(turn: Turn, recorded: Recorded, execution: ExecutionSettings) -> bool:
    """Whether its cause is on record at that time."""
    if turn.cause == SILENCE:
        moved = [t for t, _ in recorded.commands]
        moved += [other.t for other in recorded.turns if other.new == IDLE]
        last_ns = max((t for t in moved if t < turn.t), default=0)
        return turn.t - last_ns + ROUNDING_NS >= to_ns(execution.hold_before_recovery_s)
    if turn.cause == LATE:
        return execution.late_by_phase.get(turn.phase) == LateChunk.FALLBACK
    if turn.cause.startswith(OVERRUN):
        noted = f"{turn.cause.removeprefix(OVERRUN)} {DeadlineAction.FALLBACK}"
        return (turn.t, noted) in recorded.overruns
    return turn.cause == DRILL
