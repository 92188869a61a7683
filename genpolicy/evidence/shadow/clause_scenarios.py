"""What happens so that one clause of a row decides, and no other row (`clause_mutants`)."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow import voiding
from genpolicy.evidence.shadow.mutants import Scenario
from genpolicy.evidence.shadow.place_mutants import comes_after, offer, policy_under_the_fallback
from genpolicy.evidence.shadow.rig import ROWS, Rig, StandInScene, passing_verdict
from genpolicy.evidence.shadow.voiding import EVENTS, Event
from genpolicy.execution.cell import FALLBACK_HASH

UNKNOWN_PHASE = "nowhere"
"""A phase that no settings name."""
OF_THE_FALLBACK = {
    "policy_checkpoint_hash": FALLBACK_HASH, "sampler_config_hash": FALLBACK_HASH,
}  # fmt: skip
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


class Trial(NamedTuple):
    """What is tried of a clause.

    Attributes:
        scenario: What happens.
        says: What the journal must say, where nothing else shows that the clause is there.
        behind: Rows that would refuse the same, and are left out on both sides.
        changes: Of the settings of execution.
    """

    scenario: Scenario
    says: Callable[[Rig], bool] | None = None
    behind: tuple[str, ...] = ()
    changes: Mapping[str, Any] = MappingProxyType({})


def _turned_away(reason: DiscardReason) -> Callable[[Rig], bool]:
    """Whether a chunk was refused when it came, for this reason."""
    return lambda rig: any(
        event.kind == "discard"
        and (event.payload["at"], event.payload["reason"]) == ("arrival", reason)
        for event in rig.journal.events()
    )


def _rows_are_superseded(rig: Rig) -> bool:
    return any(
        event.payload["rows"].get(str(DiscardReason.SUPERSEDED))
        for event in rig.journal.events()
        if event.kind in ("discard", "finish")
    )


# -- what an event voids: what was seen before it, and what was here at it -----------------------


def _was_here(event: Event, **changes: Any) -> Scenario:
    """A chunk comes, something happens in the same moment, and a row of it is offered past all."""

    def scenario(rig: Rig) -> None:
        rig.observe()
        chunk = rig.chunk(**changes)
        rig.deliver(chunk)
        event(rig)
        rig.observe()
        offer(rig, chunk)

    return scenario


def _there_and_back(event: Event) -> Event:
    def both(rig: Rig) -> None:
        phase, epoch = rig.phase, rig.epoch
        event(rig)
        rig.phase, rig.epoch = phase, epoch
        rig.observe()

    return both


def _here_at_a_stop(rig: Rig) -> None:
    """The stub hears of a stop with the executor's next tick, and goes on by itself until then."""
    rig.observe()
    rig.deliver(rig.chunk())
    voiding.stop_and_reset(rig)
    rig.tick(2)


def _measured_before(event: Event) -> Scenario:
    """A chunk on a new observation, that was checked from where the arm was before the event."""

    def scenario(rig: Rig) -> None:
        rig.observe()
        rig.advance(0.1)
        event(rig)
        rig.run(2, context=replace(rig.context(), measured_at_s=0.0))

    return scenario


WAS_HERE: dict[str, Scenario] = {
    **{row: _was_here(event) for row, event in EVENTS.items()},
    "after_phase_transition": _was_here(_there_and_back(voiding.new_phase)),
    "after_calibration_mismatch": _was_here(_there_and_back(voiding.new_epoch)),
    "after_reset": _was_here(voiding.reset, session_epoch=1),
    "after_stop": _here_at_a_stop,
}

# -- times and order ------------------------------------------------------------------------------


def _not_yet_seen(rig: Rig) -> None:
    """It rests on an observation that is past and that nobody has seen."""
    rig.observe()
    rig.advance(0.1)
    rig.deliver(rig.chunk(condition_observation_event_time_s=0.05))
    rig.tick(2)


def _nothing_seen_since_the_reset(rig: Rig) -> None:
    rig.observe()
    rig.executor.reset(rig.now_s)
    rig.deliver(rig.chunk())
    rig.tick(2)


def _a_phase_without_an_age(rig: Rig) -> None:
    rig.phase = "insert"
    rig.run(2)


def _late(phase: str, *, first: int) -> Scenario:
    """A chunk comes four rows late; the row that was checked first is this one."""

    def scenario(rig: Rig) -> None:
        rig.phase = phase
        rig.observe()
        rig.advance(0.2)
        old = {"condition_observation_event_time_s": 0.0, "action_start_time_s": 0.0}
        rig.deliver(rig.chunk(**old, verdict=passing_verdict(rows=(first, ROWS))))
        rig.tick(2)

    return scenario


def _checked_from_a_late_row(rig: Rig) -> None:
    rig.phase = "insert"
    rig.observe()
    rig.deliver(rig.chunk(verdict=passing_verdict(rows=(4, ROWS))))
    rig.tick(6)


def _too_old_when_it_begins(rig: Rig) -> None:
    rig.observe()
    rig.advance(0.2)
    rig.deliver(rig.chunk(condition_observation_event_time_s=0.0, action_start_time_s=0.7))
    rig.tick(2)


def _over_when_it_begins(rig: Rig) -> None:
    rig.observe()
    rig.deliver(rig.chunk(action_start_time_s=0.2, valid_until_s=0.1))
    rig.tick(2)


def _behind_accepted(condition_s: float, start_s: float) -> Scenario:
    """After a row of a chunk that was seen and began at 0.1 s, which is due at 0.15 s."""

    def scenario(rig: Rig) -> None:
        rig.observe()
        rig.advance(0.1)
        rig.observe()
        rig.deliver(rig.chunk(verdict=passing_verdict(rows=(0, 1))))
        rig.tick(1)
        row = round((rig.now_s - start_s) / 0.05)
        told = {"condition_observation_event_time_s": condition_s, "action_start_time_s": start_s}
        rig.observe()
        verdict = passing_verdict(rows=(row, ROWS))
        rig.deliver(rig.chunk(**told, verdict=verdict, predecessor_chunk_id=""))
        rig.tick(1)

    return scenario


def _behind_queued(condition_s: float, start_s: float) -> Scenario:
    """Behind a waiting chunk that was seen at 0.1 s and begins at 0.3 s."""

    def scenario(rig: Rig) -> None:
        rig.observe()
        rig.advance(0.1)
        rig.observe()
        rig.deliver(rig.chunk(action_start_time_s=0.3))
        told = {"condition_observation_event_time_s": condition_s, "action_start_time_s": start_s}
        rig.deliver(rig.chunk(**told, predecessor_chunk_id=""))
        rig.tick(2)

    return scenario


def _begins_within_a_row(rig: Rig) -> None:
    """A newer chunk begins within the window of a row of the older one, which is due before."""
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick(1)
    rig.advance(0.02)
    rig.tick(1)
    rig.now_ns = 100_000_000
    rig.observe()
    rig.deliver(rig.chunk(action_start_time_s=0.12))
    rig.advance(0.03)
    rig.tick(1)


def _begins_later(rig: Rig) -> None:
    """What the older chunk has from there on is lost at once, and for this reason."""
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick(1)
    rig.observe()
    rig.deliver(rig.chunk(action_start_time_s=0.2))


# -- who commands, and in what --------------------------------------------------------------------


def _fallback_chunk(*, commands: bool, **changes: Any) -> Scenario:
    def scenario(rig: Rig) -> None:
        if commands:
            rig.executor.begin_fallback(rig.now_s)
        rig.observe()
        chunk = rig.chunk(**{**OF_THE_FALLBACK, **changes})
        rig.executor.deliver_fallback(cast(Any, chunk), rig.now_s)
        rig.tick(2)

    return scenario


def _a_controller_that_says_nothing(rig: Rig) -> None:
    rig.executor.controller(rig.now_s, "")
    rig.run(2)


def _an_unreadable_scene(rig: Rig) -> None:
    rig.executor.see(rig.now_s, {"body": ((np.nan,) * 3, UPRIGHT)})
    rig.run(2)


def _checked_in(**bodies: tuple[tuple[float, ...], tuple[float, ...]]) -> Scenario:
    """In a scene of these bodies, where none is seen."""

    def scenario(rig: Rig) -> None:
        stood = {name: (np.array(at), np.array(turn)) for name, (at, turn) in bodies.items()}
        rig.run(2, context=replace(rig.context(), scene=StandInScene(stood)))

    return scenario


TRIALS: dict[str, Trial] = {
    **{f"{row}:seen": Trial(comes_after(event)) for row, event in EVENTS.items()},
    **{f"{row}:measured": Trial(_measured_before(event)) for row, event in EVENTS.items()},
    **{f"{row}:was_here": Trial(scenario) for row, scenario in WAS_HERE.items()},
    "future_observation:newest": Trial(_not_yet_seen),
    "future_observation:unknown": Trial(_nothing_seen_since_the_reset, behind=("continuity",)),
    "stale_observation:unknown_limit": Trial(
        _a_phase_without_an_age, changes={"maximum_age_s": {"approach": 0.6}}
    ),
    "stale_observation:first_use": Trial(
        _too_old_when_it_begins, _turned_away(DiscardReason.STALE_OBSERVATION)
    ),
    "expired:first_use": Trial(_over_when_it_begins, _turned_away(DiscardReason.EXPIRED)),
    "late_chunk:unknown_phase": Trial(_late(UNKNOWN_PHASE, first=4), behind=("stale_observation",)),
    "late_chunk:first_use": Trial(_late("insert", first=0), _turned_away(DiscardReason.EXPIRED)),
    "late_chunk:checked_row": Trial(_checked_from_a_late_row),
    "behind_accepted:condition": Trial(
        _behind_accepted(0.05, 0.15), _turned_away(DiscardReason.SUPERSEDED)
    ),
    "behind_accepted:start": Trial(_behind_accepted(0.15, 0.05)),
    "behind_queued:condition": Trial(_behind_queued(0.05, 0.4)),
    "behind_queued:start": Trial(
        _behind_queued(0.1, 0.2), _turned_away(DiscardReason.OUT_OF_ORDER)
    ),
    "superseded:now": Trial(_begins_within_a_row),
    "superseded:due": Trial(_begins_later, _rows_are_superseded),
    "checked_rows:first": Trial(
        lambda rig: cast(None, rig.run(4, verdict=passing_verdict(rows=(2, ROWS)))),
        behind=("continuity",),
    ),
    "checked_rows:last": Trial(
        lambda rig: cast(None, rig.run(2, verdict=passing_verdict(rows=(0, 1))))
    ),
    "commander:of_the_policy": Trial(policy_under_the_fallback),
    "commander:of_the_fallback": Trial(_fallback_chunk(commands=False)),
    "checkpoint_mismatch:of_the_policy": Trial(
        lambda rig: cast(None, rig.run(2, policy_checkpoint_hash="0" * 64))
    ),
    "checkpoint_mismatch:of_the_fallback": Trial(
        _fallback_chunk(commands=True, policy_checkpoint_hash="0" * 64)
    ),
    "sampler_mismatch:of_the_policy": Trial(
        lambda rig: cast(None, rig.run(2, sampler_config_hash="0" * 64))
    ),
    "sampler_mismatch:of_the_fallback": Trial(
        _fallback_chunk(commands=True, sampler_config_hash="0" * 64)
    ),
    "controller_mode:unknown": Trial(_a_controller_that_says_nothing),
    "scene:unseen": Trial(_an_unreadable_scene),
    "scene:unsaid": Trial(_checked_in(body=((0.0,) * 3, (0.0,) * 4))),
    "scene:other_bodies": Trial(_checked_in(body=((0.5, 0.0, 0.0), UPRIGHT))),
}
"""By clause."""
