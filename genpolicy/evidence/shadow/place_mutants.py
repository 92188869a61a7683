"""Mutants of places: each row of the table, asked at one place alone, and then there no more.

Most rows are asked three times, so that a place that is gone is covered by the two others and
nobody sees it. Here those two are taken away on both sides: with the place that is left the
scenario must be clean, and the journal must say that this place refused, for the row's own reason;
without it the independent checker must find what went through. Which places there are is not read
from the table (`places`); of the table under test a place is only ever taken away, so that one that
it lacks lets its chunk through and the evidence is red.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple, cast

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.documents.shadow import ExecutionMutant
from genpolicy.evidence.shadow import mutants, voiding
from genpolicy.evidence.shadow.mutants import Scenario, found_in, row_of
from genpolicy.evidence.shadow.on_the_way import ASIDE_M
from genpolicy.evidence.shadow.places import ELSEWHERE, PLACES, TOLD
from genpolicy.evidence.shadow.rig import IMITATED, Rig, StandIn, passing_verdict
from genpolicy.evidence.shadow.voiding import Event
from genpolicy.execution.checks import CHECKS, Checks, Place, without
from genpolicy.execution.moment import POLICY

UNTOLD = "told.reason"
"""What stands for the rule where nobody refused at the place and for the reason that must."""


class Trial(NamedTuple):
    """What is tried of a place.

    Attributes:
        scenario: What happens.
        aside: Rules of the checker that the scenario itself breaks, whoever refuses.
    """

    scenario: Scenario
    aside: frozenset[str] = frozenset()


def offer(rig: Rig, chunk: StandIn, *, row: int = 0, arrival: int = 0) -> DiscardReason | None:
    """Offer a row of a chunk to the stub, past the executor."""
    return rig.stub.offer(
        cast(Any, chunk), chunk.actions[row], row=row, source=POLICY, arrival=arrival,
        sequence=rig.stub.arrivals, now_ns=rig.now_ns,
    )  # fmt: skip


def _never_queued(**changes: Any) -> Trial:
    """What no queue would have taken is offered to the stub."""

    def scenario(rig: Rig) -> None:
        rig.observe()
        offer(rig, rig.chunk(**changes))

    return Trial(scenario)


def _waits(event: Event) -> Trial:
    """A chunk waits, of which nothing was executed, and something happens."""

    def scenario(rig: Rig) -> None:
        rig.observe()
        rig.deliver(rig.chunk())
        event(rig)
        rig.tick(2)

    return Trial(scenario)


def comes_after(event: Event) -> Scenario:
    """Something happens, and then a chunk comes that was made before."""

    def scenario(rig: Rig) -> None:
        rig.observe()
        rig.advance(0.1)
        event(rig)
        rig.run(2, condition_observation_event_time_s=0.0)

    return scenario


def policy_under_the_fallback(rig: Rig) -> None:
    """The fallback commands, and a chunk of the policy comes."""
    rig.executor.begin_fallback(rig.now_s)
    rig.run(2)


def _offered_behind_the_end(rig: Rig) -> None:
    rig.observe()
    rig.executor.end_episode(rig.now_s)
    offer(rig, rig.chunk())


def _waiting_at_the_end(rig: Rig) -> None:
    rig.observe()
    rig.deliver(rig.chunk())
    rig.executor.end_episode(rig.now_s)


def _checked_before_a_body_moved(rig: Rig) -> None:
    rig.see(post=0.5)
    context = rig.context()
    rig.see(post=0.5 + ASIDE_M + rig.cell.execution.maximum_scene_shift_m)
    rig.run(2, context=context)


def _behind_all_its_windows(rig: Rig) -> None:
    """It comes a moment after the window of its last row, and is young enough and valid."""
    rig.observe()
    rig.advance(0.45)
    old = {"condition_observation_event_time_s": 0.0, "action_start_time_s": 0.0}
    rig.deliver(rig.chunk(**old))
    rig.tick(1)


def _already_over(rig: Rig) -> None:
    rig.advance(0.1)
    rig.run(2, valid_until_s=rig.now_s - 0.01)


TRIALS: dict[tuple[str, Place], Trial] = {
    ("end_of_episode", Place.QUEUE): Trial(_waiting_at_the_end),
    ("end_of_episode", Place.STUB): Trial(
        _offered_behind_the_end, frozenset({"journal.after_end"})
    ),
    ("infeasible", Place.STUB): _never_queued(verdict=passing_verdict(failed=2)),
    ("period", Place.STUB): _never_queued(action_period_s=0.1),
    ("action_hash", Place.STUB): _never_queued(actions_sha256="0" * 64),
    ("intervention", Place.QUEUE): _waits(lambda rig: rig.executor.intervene(rig.now_s)),
    ("intervention", Place.STUB): _waits(lambda rig: rig.executor.intervene(rig.now_s)),
    ("commander", Place.ARRIVAL): Trial(policy_under_the_fallback),
    ("after_force_event", Place.ARRIVAL): Trial(comes_after(voiding.felt)),
    ("after_collision_event", Place.ARRIVAL): Trial(comes_after(voiding.collided)),
    ("after_observation_divergence", Place.ARRIVAL): Trial(comes_after(voiding.diverged)),
    ("scene", Place.ARRIVAL): Trial(_checked_before_a_body_moved),
    ("expired", Place.ARRIVAL): Trial(_already_over),
    ("window", Place.ARRIVAL): Trial(_behind_all_its_windows),
}
"""Places of which the row's own scenario (`mutants.SCENARIOS`) says nothing."""


def pairs() -> Iterator[tuple[str, Place]]:
    """Every row with every place that has a mutant here."""
    for name, asked in PLACES.items():
        for place in asked.places:
            if place not in ELSEWHERE:
                yield name, place


def place_mutants(checks: Checks = CHECKS) -> list[ExecutionMutant]:
    """Play the scenario of every place with that place alone, and without it.

    Args:
        checks: The table under test; another one is for the tests.

    Returns:
        One row per row and place, in the order of the list.
    """
    without_row: dict[tuple[str, Scenario], Rig] = {}
    return [_mutant(checks, name, place, without_row) for name, place in pairs()]


def _mutant(
    checks: Checks, name: str, place: Place, without_row: dict[tuple[str, Scenario], Rig]
) -> ExecutionMutant:
    table = checks if name not in {row.name for row in IMITATED} else without(checks, "issued")
    trial = TRIALS.get((name, place)) or Trial(mutants.SCENARIOS[name])
    alone = _played(name, trial, alone_at(table, name, place))
    key = (name, trial.scenario)
    if key not in without_row:
        without_row[key] = _played(name, trial, alone_at(table, name, None))
    blind = without_row[key]
    found, unchanged = (found_in(rig, trial.aside) for rig in (blind, alone))
    if not is_told(name, place, by=alone, but_not_by=blind):
        unchanged.append(UNTOLD)
    return row_of(f"{name}@{place}", found, unchanged)


def alone_at(table: Checks, name: str, place: Place | None) -> Checks:
    """The table with a row that is asked at this place alone, if it was asked there; else nowhere.

    A place is never given, only taken.
    """
    return tuple(
        row._replace(places=row.places & frozenset([place] if place else []))
        if row.name == name
        else row
        for row in table
    )


def _played(name: str, trial: Trial, table: Checks) -> Rig:
    rig = Rig(checks=table, session=name)
    trial.scenario(rig)
    rig.executor.end_episode(rig.now_s)
    return rig


def is_told(name: str, place: Place, *, by: Rig, but_not_by: Rig) -> bool:
    """Whether a journal says, and another does not, that this place refused for the row's reason.

    True of a place of which no journal says anything.
    """
    return place not in TOLD or _times_told(by, name, place) > _times_told(but_not_by, name, place)


def _times_told(rig: Rig, name: str, place: Place) -> int:
    reason, at = PLACES[name].reason, TOLD[place]
    kind = "refuse" if at == "stub" else "discard"
    return sum(
        event.kind == kind
        and event.payload["reason"] == reason
        and event.payload.get("at", at) == at
        for event in rig.journal.events()
    )
