"""The table of checks: every question that is asked of a chunk before one of its actions moves.

One row is one question, its answer (`True` holds) and the reason for discarding where it does not.
Whoever asks (executor, controller stub, freshness layer, supervisor) brings a `Moment` from its
own bookkeeping and the table it was built with; the rows that concern it are those of its place.
There is no switch: a mutant is built with the tuple minus one row, and the independent checker
(`genpolicy.verification`), which knows neither this table nor its words, must notice.

All times are whole nanoseconds. A fact that is unknown does not hold.
"""

from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple, Protocol, TypeVar

from genpolicy.contract.chunk import DiscardReason
from genpolicy.errors import ConfigError
from genpolicy.execution.moment import FALLBACK, MODE_OF_SOURCE, ExecutorMode, Moment
from genpolicy.execution.nanoseconds import NEVER_NS, ChunkTimes
from genpolicy.execution.scene import moved_m


class Place(StrEnum):
    """Where a question is asked."""

    OBSERVED = "observed"
    """Of an observation: may what was made before it still be used?"""
    DOOR = "door"
    """Of whatever arrives, before it is read."""
    ARRIVAL = "arrival"
    QUEUE = "queue"
    """Of every waiting chunk, on each event and before each command."""
    ROOM = "room"
    """Of the queue, when a chunk enters it: the oldest leaves until there is room."""
    ROWS = "rows"
    """Of each row, when a chunk enters the queue: may it be executed at all?"""
    PAST = "past"
    """Of the next row, before each command: has its time gone by?"""
    DUE = "due"
    """Of the next row: is it the command of this moment?"""
    NEXT = "next"
    """Of the row that is: does it continue what was commanded?"""
    STUB = "stub"
    LAYER = "layer"
    """In the freshness layer of feasibility."""
    SUPERVISOR = "supervisor"


class Check(NamedTuple):
    """One question.

    Attributes:
        name: Its name.
        holds: Whether the answer is as it should be; False where a fact is unknown.
        reason: Why a chunk is discarded where it does not; None: nothing is discarded, it holds.
        places: Where it is asked.
        margin_ns: Limit minus value, ns, where the question is one of time; None: no limit yet.
    """

    name: str
    holds: Callable[[Moment], bool]
    reason: DiscardReason | None
    places: frozenset[Place]
    margin_ns: Callable[[Moment], int | None] | None = None


Checks = tuple[Check, ...]

MOST_OF_A_PERIOD, LEAST_OF_A_PERIOD = 9, 10
"""Two commands are nine tenths of a period apart or more: they were checked at a whole one, and
what comes faster moves faster than anything that was checked. A tenth is left to a clock."""


class Named(Protocol):
    """A row of a table of checks."""

    @property
    def name(self) -> str:
        """Its name, unique in its table."""


Row = TypeVar("Row", bound=Named)


def refusal(checks: Checks, place: Place, moment: Moment) -> Check | None:
    """The first row of this place that does not hold; None if all do."""
    return next((c for c in checks if place in c.places and not c.holds(moment)), None)


def without(table: tuple[Row, ...], *names: str) -> tuple[Row, ...]:
    """A table of checks, this one or that of the layers, minus the rows of these names.

    Raises:
        ConfigError: It has no row of such a name.
    """
    unknown = set(names) - {row.name for row in table}
    if unknown:
        raise ConfigError(
            where="the checks to leave out",
            found=f"{sorted(unknown)}",
            expected=f"names out of {[row.name for row in table]}",
            action="Correct the name.",
        )
    return tuple(row for row in table if row.name not in names)


def at(checks: Checks, place: Place) -> Checks:
    """The rows that are asked at a place, in their order."""
    return tuple(check for check in checks if place in check.places)


def missing(*tables: Checks) -> list[str]:
    """Names of the rows of `CHECKS` that one of the tables lacks, for the journal to declare."""
    return sorted({check.name for table in tables for check in set(CHECKS) - set(table)})


# -- the questions, one definition each -------------------------------------------------------


def _future_margin_ns(m: Moment) -> int:
    condition_ns, newest_ns = m.chunk.times.condition_ns, m.view.newest_observation_ns
    return min(m.now_ns, NEVER_NS if newest_ns is None else newest_ns) - condition_ns


def _age_margin_ns(m: Moment) -> int:
    limit_ns = m.view.maximum_age_ns
    first_use_ns = m.now_ns if m.first_use_ns is None else m.first_use_ns
    return (-1 if limit_ns is None else limit_ns) - (first_use_ns - m.chunk.times.condition_ns)


def _validity_margin_ns(m: Moment) -> int:
    first_use_ns = m.now_ns if m.first_use_ns is None else m.first_use_ns
    return m.chunk.times.valid_until_ns - first_use_ns


def _behind_margin_ns(m: Moment) -> int | None:
    return _least_behind(m.chunk.times, m.accepted_condition_ns, m.accepted_start_ns)


def _behind_queued_margin_ns(m: Moment) -> int | None:
    return _least_behind(m.chunk.times, m.queued_condition_ns, m.queued_start_ns)


def _least_behind(times: ChunkTimes, condition_ns: int | None, start_ns: int | None) -> int | None:
    margins = [] if condition_ns is None else [times.condition_ns - condition_ns]
    margins += [] if start_ns is None else [times.start_ns - start_ns]
    return min(margins, default=None)


def _maker_is(m: Moment, field_name: str, active: str) -> bool:
    expected = m.view.fallback if m.chunk.source == FALLBACK else active
    return bool(expected) and getattr(m.chunk.metadata, field_name) == expected


def _not_superseded(m: Moment) -> bool:
    newer_ns = m.newer_start_ns
    return newer_ns is None or (m.now_ns < newer_ns and m.due_ns < newer_ns)


def _begins_in_time(m: Moment) -> bool:
    times, first, latest = m.chunk.times, m.chunk.checked_rows[0], m.view.latest_first_row
    if m.first_use_ns is not None:
        first = max(first, (m.first_use_ns - times.start_ns) // times.period_ns)
    return latest is not None and first <= latest


def _in_checked_rows(m: Moment) -> bool:
    first, last = m.chunk.checked_rows
    return m.row is not None and first <= m.row < last


def _within_horizon(m: Moment) -> bool:
    usable = min(m.chunk.rows, m.view.execution_horizon)
    return m.row is not None and 0 <= m.row < usable


def _in_declared_mode(m: Moment) -> bool:
    return bool(m.view.controller) and m.view.controller == m.view.controller_mode


def _in_this_scene(m: Moment) -> bool:
    return m.view.scene_limit_m - moved_m(m.chunk.scene, m.view.scene) >= 0


def _where_it_was_sent(m: Moment) -> bool:
    return m.divergence_m is None or m.view.divergence_limit_m - m.divergence_m >= 0


def _awake(m: Moment) -> bool:
    return m.last_accept_ns is None or m.watchdog_ns - (m.now_ns - m.last_accept_ns) >= 0


def _not_at_once(m: Moment) -> bool:
    if m.last_accept_ns is None:
        return True
    return LEAST_OF_A_PERIOD * (m.now_ns - m.last_accept_ns) >= m.view.period_ns * MOST_OF_A_PERIOD


def _after(reason: DiscardReason) -> Callable[[Moment], bool]:
    def holds(m: Moment) -> bool:
        event = m.view.voidings.get(reason)
        if event is None:
            return True
        chunk = m.chunk
        # A plan on a new image that was checked from where the arm stood before is one from before.
        seen_ns = min(chunk.times.condition_ns, chunk.measured_ns)
        return seen_ns - event.before_ns >= 0 and chunk.arrival >= event.arrivals

    return holds


def _timed(
    name: str, margin_ns: Callable[[Moment], int | None], reason: DiscardReason, *places: Place
) -> Check:
    def holds(m: Moment) -> bool:
        margin = margin_ns(m)
        return margin is None or margin >= 0

    return Check(name, holds, reason, frozenset(places), margin_ns)


def _row(
    name: str, holds: Callable[[Moment], bool], reason: DiscardReason | None, *places: Place
) -> Check:
    return Check(name, holds, reason, frozenset(places))


_R, _P = DiscardReason, Place
_LIVE = (Place.ARRIVAL, Place.QUEUE, Place.STUB)

CHECKS: Checks = (
    _row("end_of_episode", lambda m: m.view.mode != ExecutorMode.ENDED,
         _R.END_OF_EPISODE, _P.DOOR, _P.QUEUE, _P.STUB),
    _row("issued", lambda m: m.issued is True, _R.INFEASIBLE, _P.DOOR, _P.STUB),
    _row("duplicate", lambda m: m.known is False, _R.DUPLICATE, _P.DOOR),
    _row("infeasible", lambda m: m.chunk.passed, _R.INFEASIBLE, _P.ARRIVAL, _P.STUB),
    _row("period", lambda m: m.chunk.times.period_ns == m.view.period_ns,
         _R.INFEASIBLE, _P.ARRIVAL, _P.STUB),
    _row("action_hash", lambda m: m.chunk.hashed, _R.INFEASIBLE, _P.ARRIVAL, _P.STUB),
    _row("same_action", lambda m: m.same_action is True, _R.INFEASIBLE, _P.STUB),
    _row("execution_horizon", _within_horizon, _R.INFEASIBLE, _P.ROWS, _P.STUB),
    _row("checked_rows", _in_checked_rows, _R.INFEASIBLE, _P.ROWS, _P.STUB),
    _row("intervention", lambda m: m.view.mode != ExecutorMode.INTERVENTION,
         _R.INTERVENTION, *_LIVE),
    _row("stopped", lambda m: not m.view.stopped, _R.STOPPED, *_LIVE),
    _row("commander", lambda m: m.view.mode != MODE_OF_SOURCE[m.chunk.source], _R.STOPPED, *_LIVE),
    _row("controller_mode", _in_declared_mode, _R.STOPPED, *_LIVE),
    _row("session_epoch", lambda m: m.chunk.metadata.session_epoch == m.view.session_epoch,
         _R.RESET, *_LIVE, _P.LAYER),
    _row("checkpoint_mismatch",
         lambda m: _maker_is(m, "policy_checkpoint_hash", m.view.checkpoint),
         _R.CHECKPOINT_MISMATCH, *_LIVE, _P.LAYER),
    _row("sampler_mismatch", lambda m: _maker_is(m, "sampler_config_hash", m.view.sampler),
         _R.SAMPLER_MISMATCH, *_LIVE, _P.LAYER),
    _row("calibration_mismatch",
         lambda m: m.chunk.metadata.calibration_epoch == m.view.calibration_epoch,
         _R.CALIBRATION_MISMATCH, *_LIVE, _P.LAYER),
    _row("phase_transition", lambda m: m.chunk.metadata.task_phase == m.view.phase,
         _R.PHASE_TRANSITION, *_LIVE, _P.LAYER),
    _timed("future_observation", _future_margin_ns, _R.FUTURE_OBSERVATION, *_LIVE, _P.LAYER),
    _timed("stale_observation", _age_margin_ns, _R.STALE_OBSERVATION, *_LIVE, _P.LAYER),
    _row("after_phase_transition", _after(_R.PHASE_TRANSITION), _R.PHASE_TRANSITION, *_LIVE),
    _row("after_calibration_mismatch", _after(_R.CALIBRATION_MISMATCH),
         _R.CALIBRATION_MISMATCH, *_LIVE),
    _row("after_force_event", _after(_R.FORCE_EVENT), _R.FORCE_EVENT, *_LIVE),
    _row("after_collision_event", _after(_R.COLLISION_EVENT), _R.COLLISION_EVENT, *_LIVE),
    _row("after_observation_divergence", _after(_R.OBSERVATION_DIVERGENCE),
         _R.OBSERVATION_DIVERGENCE, *_LIVE),
    _row("after_intervention", _after(_R.INTERVENTION), _R.INTERVENTION, *_LIVE),
    _row("after_stop", _after(_R.STOPPED), _R.STOPPED, *_LIVE),
    _row("after_reset", _after(_R.RESET), _R.RESET, *_LIVE),
    _row("scene", _in_this_scene, _R.OBSERVATION_DIVERGENCE, *_LIVE),
    _timed("expired", _validity_margin_ns, _R.EXPIRED, *_LIVE, _P.LAYER),
    _row("early", lambda m: m.due_ns <= m.now_ns, _R.EXPIRED, _P.DUE, _P.STUB),
    _row("window", lambda m: m.now_ns < m.due_ns + m.view.period_ns,
         _R.EXPIRED, _P.ARRIVAL, _P.PAST, _P.STUB),
    _row("late_chunk", _begins_in_time, _R.EXPIRED, _P.ARRIVAL, _P.STUB),
    _timed("behind_accepted", _behind_margin_ns, _R.SUPERSEDED, _P.ARRIVAL, _P.LAYER),
    _timed("behind_queued", _behind_queued_margin_ns, _R.OUT_OF_ORDER, _P.ARRIVAL),
    _row("predecessor",
         lambda m: m.chunk.metadata.predecessor_chunk_id in ("", m.head),
         _R.BROKEN_PREDECESSOR, _P.ARRIVAL),
    _row("queue_overflow", lambda m: m.waiting < m.capacity, _R.QUEUE_OVERFLOW, _P.ROOM),
    _row("superseded", _not_superseded, _R.SUPERSEDED, _P.ROWS, _P.DUE),
    _row("out_of_order", lambda m: m.last_due_ns is None or m.due_ns > m.last_due_ns,
         _R.OUT_OF_ORDER, _P.DUE, _P.STUB),
    _row("sequence", lambda m: m.sequence is not None and m.sequence > m.last_sequence,
         _R.OUT_OF_ORDER, _P.STUB),
    _row("continuity", lambda m: m.follows is True, _R.BROKEN_PREDECESSOR, _P.NEXT, _P.STUB),
    _row("pace", _not_at_once, _R.OUT_OF_ORDER, _P.DUE, _P.STUB),
    _row("divergence", _where_it_was_sent, _R.OBSERVATION_DIVERGENCE, _P.OBSERVED),
    _row("watchdog", _awake, None, _P.SUPERVISOR),
)  # fmt: skip
"""In the order in which they decide: the first row that does not hold names the reason."""
