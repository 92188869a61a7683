"""Clauses of the table of checks: one fact of a row, which is told what it likes to hear of it.

A row that asks several things goes on refusing with one of them gone, so that taking the whole row
away says nothing of each. A clause is taken away by telling the row's own predicate something else
of that fact alone: no predicate is written twice, and one that has lost the clause already differs
from its mutant in nothing, which turns the evidence red (`clause_mutants`).
"""

from collections.abc import Callable
from dataclasses import replace

from genpolicy.contract.chunk import DiscardReason as R
from genpolicy.execution.moment import FALLBACK, POLICY, Chunk, ExecutorMode, Moment
from genpolicy.execution.nanoseconds import NEVER_NS

Told = Callable[[Moment], Moment]
ALWAYS_NS = -NEVER_NS
ROWS_WITHOUT_END = 1 << 20


def _view(**changes: object) -> Told:
    return lambda m: replace(m, view=replace(m.view, **changes))  # type: ignore[arg-type]


def _moment(**changes: object) -> Told:
    return lambda m: replace(m, **changes)  # type: ignore[arg-type]


def _of_chunk(change: Callable[[Chunk], Chunk]) -> Told:
    return lambda m: replace(m, about=change(m.chunk))


def _only(where: Callable[[Moment], bool], told: Told) -> Told:
    return lambda m: told(m) if where(m) else m


def _made_by(source: str) -> Callable[[Moment], bool]:
    return lambda m: m.chunk.source == source


def _voided(reason: R, **changes: int) -> Told:
    """The event voids less: nothing of what had arrived."""

    def told(m: Moment) -> Moment:
        event = m.view.voidings.get(reason)
        if event is None:
            return m
        voidings = {**m.view.voidings, reason: event._replace(**changes)}
        return replace(m, view=replace(m.view, voidings=voidings))

    return told


def _seen_when_measured(chunk: Chunk) -> Chunk:
    seen_ns = max(chunk.times.condition_ns, chunk.measured_ns)
    return replace(chunk, times=replace(chunk.times, condition_ns=seen_ns))


def _measured_when_seen(chunk: Chunk) -> Chunk:
    return replace(chunk, measured_ns=max(chunk.times.condition_ns, chunk.measured_ns))


def _its_maker_is_active(field: str) -> Told:
    """Whoever made the chunk commands."""

    def told(m: Moment) -> Moment:
        made = m.chunk.metadata
        maker = made.sampler_config_hash if field == "sampler" else made.policy_checkpoint_hash
        return _view(**{"fallback" if m.chunk.source == FALLBACK else field: maker})(m)

    return told


def _other_bodies(m: Moment) -> bool:
    chunk, seen = m.chunk.scene, m.view.scene
    return chunk is not None and seen is not None and chunk.keys() != seen.keys()


def _seen_as_checked(m: Moment) -> Moment:
    return replace(m, view=replace(m.view, scene=m.chunk.scene or {}))


VOIDED_BY = {
    "after_phase_transition": R.PHASE_TRANSITION,
    "after_calibration_mismatch": R.CALIBRATION_MISMATCH,
    "after_force_event": R.FORCE_EVENT,
    "after_collision_event": R.COLLISION_EVENT,
    "after_observation_divergence": R.OBSERVATION_DIVERGENCE,
    "after_intervention": R.INTERVENTION,
    "after_stop": R.STOPPED,
    "after_reset": R.RESET,
}
"""Rows of what an event voids, and its reason."""

CLAUSES: dict[str, Told] = {
    **{
        f"{row}:{half}": told
        for row, reason in VOIDED_BY.items()
        for half, told in (
            ("seen", _of_chunk(_seen_when_measured)),
            ("measured", _of_chunk(_measured_when_seen)),
            ("was_here", _voided(reason, arrivals=0)),
        )
    },
    "future_observation:newest": lambda m: (
        m if m.view.newest_observation_ns is None else _view(newest_observation_ns=m.now_ns)(m)
    ),
    "future_observation:unknown": lambda m: (
        _view(newest_observation_ns=m.now_ns)(m) if m.view.newest_observation_ns is None else m
    ),
    "stale_observation:unknown_limit": _only(
        lambda m: m.view.maximum_age_ns is None, _view(maximum_age_ns=ALWAYS_NS)
    ),
    "stale_observation:first_use": _moment(first_use_ns=None),
    "expired:first_use": _moment(first_use_ns=None),
    "late_chunk:unknown_phase": _only(
        lambda m: m.view.latest_first_row is None, _view(latest_first_row=ROWS_WITHOUT_END)
    ),
    "late_chunk:first_use": _moment(first_use_ns=None),
    "late_chunk:checked_row": _of_chunk(
        lambda chunk: replace(chunk, checked_rows=(0, chunk.checked_rows[1]))
    ),
    "behind_accepted:condition": _moment(accepted_condition_ns=None),
    "behind_accepted:start": _moment(accepted_start_ns=None),
    "behind_queued:condition": _moment(queued_condition_ns=None),
    "behind_queued:start": _moment(queued_start_ns=None),
    "superseded:now": _moment(now_ns=NEVER_NS),
    "superseded:due": _moment(row=-ROWS_WITHOUT_END),
    "checked_rows:first": _of_chunk(
        lambda chunk: replace(chunk, checked_rows=(0, chunk.checked_rows[1]))
    ),
    "checked_rows:last": _of_chunk(
        lambda chunk: replace(chunk, checked_rows=(chunk.checked_rows[0], ROWS_WITHOUT_END))
    ),
    "commander:of_the_policy": _only(_made_by(POLICY), _view(mode=ExecutorMode.RUN)),
    "commander:of_the_fallback": _only(_made_by(FALLBACK), _view(mode=ExecutorMode.FALLBACK)),
    "checkpoint_mismatch:of_the_policy": _only(
        _made_by(POLICY), _its_maker_is_active("checkpoint")
    ),
    "checkpoint_mismatch:of_the_fallback": _only(
        _made_by(FALLBACK), _its_maker_is_active("checkpoint")
    ),
    "sampler_mismatch:of_the_policy": _only(_made_by(POLICY), _its_maker_is_active("sampler")),
    "sampler_mismatch:of_the_fallback": _only(_made_by(FALLBACK), _its_maker_is_active("sampler")),
    "controller_mode:unknown": lambda m: (
        m if m.view.controller else _view(controller=m.view.controller_mode)(m)
    ),
    "scene:unseen": _only(lambda m: m.view.scene is None, _seen_as_checked),
    "scene:unsaid": lambda m: (
        _of_chunk(lambda chunk: replace(chunk, scene=m.view.scene))(m)
        if m.chunk.scene is None
        else m
    ),
    "scene:other_bodies": _only(_other_bodies, _seen_as_checked),
}
"""Each clause by its row, and what the row is told instead. Of the rows that are not here there is
one clause, so that the row itself is its mutant."""
