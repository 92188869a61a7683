"""Mutants of continuity: each thing that it asks of the way to a row, left out of it once.

Of the table it is one row, which asks whether feasibility checked the way from the last command;
how that is found out (`genpolicy/execution/continuity.py`) is many. As in `clause_mutants` executor
and stub lack the same, and the scenario must be clean with nothing left out, also where only one of
them asks: each keeps its own record of what was commanded. What was forgotten because nobody knows
where the arm is shows by what may go on: a chunk that was checked from elsewhere.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from genpolicy.contract.action import POSITION
from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.documents.shadow import ExecutionMutant
from genpolicy.evidence.shadow import voiding
from genpolicy.evidence.shadow.clause_scenarios import Trial
from genpolicy.evidence.shadow.mutants import found_in, row_of
from genpolicy.evidence.shadow.place_mutants import UNTOLD, alone_at
from genpolicy.evidence.shadow.rig import PERIOD_S, Rig, passing_verdict
from genpolicy.evidence.shadow.voiding import Event
from genpolicy.execution.checks import CHECKS, Checks, Place, without
from genpolicy.execution.continuity import Continuity
from genpolicy.execution.moment import Chunk, Position, View

ROW = "continuity"
AN_HOUR_S = 3600.0
BEFORE = 2
"""Commands before the last one that a scenario leaves out."""


class WithoutHold(Continuity):
    """A chunk goes on with its next row, however long the arm was held."""

    def follows(self, chunk: Any, about: Chunk, row: int, now_ns: int, view: View) -> bool:
        """Asks whether it is the next row of the same chunk, and nothing else."""
        last = self._last
        if last is not None and last.chunk is chunk:
            return row == last.row + 1
        return super().follows(chunk, about, row, now_ns, view)


class WithoutFirstRow(Continuity):
    """Another chunk begins at any row."""

    def follows(self, chunk: Any, about: Chunk, row: int, now_ns: int, view: View) -> bool:
        """Takes the row for the first that was checked."""
        if self._last is None or self._last.chunk is not chunk:
            about = replace(about, checked_rows=(row, about.checked_rows[1]))
        return super().follows(chunk, about, row, now_ns, view)


class _Credulous(Continuity):
    """Another chunk was checked from what it should have been, in one respect."""

    def follows(self, chunk: Any, about: Chunk, row: int, now_ns: int, view: View) -> bool:
        """Asks about a chunk that was checked from something else."""
        if self._last is not None and self._last.chunk is not chunk:
            context = replace(chunk.context, **self._should(chunk.context))
            chunk = replace(chunk, context=context)
        return super().follows(chunk, about, row, now_ns, view)

    def _should(self, context: Any) -> dict[str, Any]:
        raise NotImplementedError


class WithoutLastCommand(_Credulous):
    """A chunk was checked from whatever it was."""

    def _should(self, context: Any) -> dict[str, Any]:
        assert self._last is not None, "asked behind a command"
        return {"last_action": np.frombuffer(self._last.action, dtype="<f8")}


class WithoutRest(_Credulous):
    """A chunk that comes after a hold was checked in any motion."""

    def _should(self, context: Any) -> dict[str, Any]:
        return {"q_cmd_history": np.tile(context.q_cmd, (len(context.q_cmd_history), 1))}


class WithoutCommandsBefore(_Credulous):
    """A chunk leaves out the commands before the last one."""

    def _should(self, context: Any) -> dict[str, Any]:
        before = np.tile(context.q_cmd, (BEFORE, 1))
        return {"q_cmd_history": np.concatenate([before, context.q_cmd_history])}


class WithoutHeld(Continuity):
    """It is not told that the watchdog holds, or that a clock is doubted."""

    def held(self, *at: Any, **more: Any) -> None:
        """Hears nothing."""


class WithoutForgetting(Continuity):
    """It knows where the arm is whoever moved it."""

    def forget(self) -> None:
        """Keeps what was commanded last."""


class WithoutHere(Continuity):
    """Where no command says where the arm is, a chunk begins wherever it was checked from."""

    def follows(self, chunk: Any, about: Chunk, row: int, now_ns: int, view: View) -> bool:
        """Takes where the chunk begins for where the arm is seen, if it is seen."""
        if view.tcp_m is not None:
            view = replace(view, tcp_m=_told_m(chunk))
        return super().follows(chunk, about, row, now_ns, view)


class WithoutUnseen(Continuity):
    """The same, where nobody says where the arm is seen."""

    def follows(self, chunk: Any, about: Chunk, row: int, now_ns: int, view: View) -> bool:
        """Takes where the chunk begins for where the arm is, if nobody sees it."""
        if view.tcp_m is None:
            view = replace(view, tcp_m=_told_m(chunk))
        return super().follows(chunk, about, row, now_ns, view)


class WithoutMotion(Continuity):
    """Where no command says how the arm moves, a chunk begins from any motion, known or not."""

    def follows(self, chunk: Any, about: Chunk, row: int, now_ns: int, view: View) -> bool:
        """Takes the arm of a chunk that begins for one that was measured at rest."""
        if self._last is None:
            context = replace(chunk.context, dq_meas=np.zeros_like(chunk.context.q_meas))
            chunk = replace(chunk, context=context)
        return super().follows(chunk, about, row, now_ns, view)


def _told_m(chunk: Any) -> Position:
    x, y, z = chunk.context.last_action[POSITION]
    return x, y, z


class Clause(NamedTuple):
    """Something that continuity asks.

    Attributes:
        lacks: Continuity without it.
        trial: Its scenario.
    """

    lacks: type[Continuity]
    trial: Trial


def _is_discarded(rig: Rig) -> bool:
    return any(
        event.kind == "discard" and event.payload["reason"] == DiscardReason.BROKEN_PREDECESSOR
        for event in rig.journal.events()
    )


def _four_are_accepted(rig: Rig) -> bool:
    return rig.stub.accepted == 4


def _second(**context: Any) -> Callable[[Rig], None]:
    """After three rows of a chunk another one goes on, that says it was checked from these."""

    def scenario(rig: Rig) -> None:
        rig.run(3, verdict=passing_verdict(rows=(0, 3)))
        _checked_from(rig, **context)

    return scenario


def _checked_from(rig: Rig, **context: Any) -> None:
    rig.run(2, context=replace(rig.context(), **context), predecessor_chunk_id="")


def _almost_two_periods_later(rig: Rig) -> None:
    """A row is given at the begin of its window, and the next one at the end of its own."""
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick(1)
    rig.advance(0.04)
    rig.tick(1)


def _at_its_second_row(rig: Rig) -> None:
    rig.run(3, verdict=passing_verdict(rows=(0, 3)))
    rig.observe()
    rig.deliver(rig.chunk(action_start_time_s=rig.now_s - PERIOD_S, predecessor_chunk_id=""))
    rig.tick(2)


def _in_motion_after_a_hold(rig: Rig) -> None:
    rig.run(3, verdict=passing_verdict(rows=(0, 3)))
    rig.advance(2 * PERIOD_S)
    _checked_from(rig, q_cmd_history=np.array([[-0.2], [-0.1]]))


def _held_between(hold: Event) -> Callable[[Rig], None]:
    """Between two rows, by the clock not much more than a period apart, the arm was held."""

    def scenario(rig: Rig) -> None:
        rig.observe()
        rig.deliver(rig.chunk())
        rig.tick(1)
        rig.advance(0.01, poll=False)
        hold(rig)
        rig.advance(0.01, poll=False)
        rig.tick(1)

    return scenario


def _moved_by(event: Event) -> Callable[[Rig], None]:
    """After two rows somebody may have moved the arm; a chunk is made from where it is now."""

    def scenario(rig: Rig) -> None:
        rig.run(2, verdict=passing_verdict(rows=(0, 2)))
        event(rig)
        _checked_from(rig, last_action=np.full(10, 0.5))

    return scenario


def _elsewhere(rig: Rig) -> None:
    """The first chunk of a session was checked from somewhere else than where the arm is seen."""
    rig.observe()
    context = replace(rig.context(), last_action=np.full(10, 0.5))
    rig.deliver(rig.chunk(context=context))
    rig.tick(2)


def _unseen(rig: Rig) -> None:
    """An observation does not say where the arm is."""
    rig.executor.observe(rig.now_s, rig.now_s, rig.phase, rig.epoch)
    rig.deliver(rig.chunk())
    rig.tick(2)


def _from_unknown_motion(rig: Rig) -> None:
    """The first chunk of a session knows one command before, and no measured velocity."""
    rig.observe()
    rig.deliver(rig.chunk(context=replace(rig.context(), q_cmd_history=np.zeros((1, 1)))))
    rig.tick(2)


CLAUSES = {
    "here": Clause(WithoutHere, Trial(_elsewhere)),
    "unseen": Clause(WithoutUnseen, Trial(_unseen)),
    "motion": Clause(WithoutMotion, Trial(_from_unknown_motion)),
    "hold": Clause(WithoutHold, Trial(_almost_two_periods_later)),
    "first_row": Clause(WithoutFirstRow, Trial(_at_its_second_row)),
    "last_command": Clause(WithoutLastCommand, Trial(_second(last_action=np.full(10, 0.5)))),
    "rest": Clause(WithoutRest, Trial(_in_motion_after_a_hold)),
    "commands_before": Clause(
        WithoutCommandsBefore, Trial(_second(q_cmd_history=np.zeros((0, 1))), _is_discarded)
    ),
    "watchdog": Clause(
        WithoutHeld,
        Trial(
            _held_between(lambda rig: rig.stub.poll(rig.now_s)), changes={"watchdog_s": PERIOD_S}
        ),
    ),
    "doubt": Clause(
        WithoutHeld,
        Trial(_held_between(lambda rig: rig.executor.tick(rig.now_s + AN_HOUR_S))),
    ),
    **{
        name: Clause(WithoutForgetting, Trial(_moved_by(event), _four_are_accepted))
        for name, event in (
            ("person", voiding.a_person_takes_over_and_hands_back),
            ("reset", voiding.reset),
            ("stop", voiding.stop_and_reset),
        )
    },
}  # fmt: skip
"""By name. Two ask where the arm is, one how it moves, two of rows, three of what a chunk was
checked from, two of holds that no clock tells, and three of who moved the arm."""


def continuity_mutants(checks: Checks = CHECKS) -> list[ExecutionMutant]:
    """Play the scenario of every clause with continuity whole, and without the clause.

    Args:
        checks: The table under test; another one is for the tests.

    Returns:
        One row per clause.
    """
    return [continuity_mutant(checks, name) for name in CLAUSES]


def continuity_mutant(checks: Checks, name: str) -> ExecutionMutant:
    """The same of one clause."""
    lacks, trial = CLAUSES[name]
    table = without(checks, "issued")
    whole = _played(name, trial, table)
    unchanged = _found(trial, whole)
    found = _found(trial, _played(name, trial, table, lacks))
    slipped = 0
    for place in (Place.NEXT, Place.STUB):
        one = _played(name, trial, alone_at(table, ROW, place))
        unchanged += _found(trial, one)
        slipped += max(0, one.stub.accepted - whole.stub.accepted)
    return row_of(f"{ROW}:{name}", found, unchanged, slipped)


def _played(name: str, trial: Trial, table: Checks, lacks: type[Continuity] | None = None) -> Rig:
    rig = Rig(checks=table, session=name, **trial.changes)
    if lacks is not None:
        rig.stub._continuity, rig.executor._queue.continuity = lacks(), lacks()
    trial.scenario(rig)
    rig.executor.end_episode(rig.now_s)
    return rig


def _found(trial: Trial, rig: Rig) -> list[str]:
    unsaid = trial.says is not None and not trial.says(rig)
    return found_in(rig) + [UNTOLD] * unsaid
