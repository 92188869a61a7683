"""Section `execution`, and the cell that runs under it: one home of what holds in execution.

Executor, controller stub, supervisor and recovery all read the section itself; nothing is copied
out of it. Times are in s; whole ns, for those who compare, are derived here.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import Annotated, Any

from pydantic import Field, field_serializer, model_validator

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.latency import FITTING, DeadlineAction, Term, TermDeadline
from genpolicy.contract.settings import Settings
from genpolicy.errors import ConfigError
from genpolicy.execution.moment import Position, View
from genpolicy.execution.nanoseconds import to_ns
from genpolicy.robot.controller import CONTROLLER_MODE

DEFAULT = "default"
"""Key of a table by phase whose value holds for every phase that the table does not name."""

FALLBACK_HASH = "classical-fallback"
"""Identity of the task's fallback planner, in place of a checkpoint and of a sampler."""

NotNegative = Annotated[float, Field(ge=0)]


class RecoveryState(StrEnum):
    """Where recovery stands; IDLE while the policy commands, PERSON while a person does."""

    IDLE = "idle"
    HOLD = "hold"
    RETREAT = "retreat"
    CLASSICAL_RETURN = "classical_return"
    ASK_HUMAN = "ask_human"
    PERSON = "person"
    ABORT = "abort"
    STOPPED = "stopped"


PRIMITIVES = (RecoveryState.RETREAT, RecoveryState.CLASSICAL_RETURN)


class LateChunk(StrEnum):
    """What a phase declares for a chunk that comes too late to begin where it was meant to."""

    CONTINUE = "continue"
    """It begins at a later row, as long as it is valid and young enough."""
    HOLD = "hold"
    """It is discarded, and the controller holds until the next one."""
    FALLBACK = "fallback"
    """It is discarded, and recovery begins."""


class ExecutionSettings(Settings):
    """Section `execution`: fixtures of executor, supervisor and recovery, equal for all methods.

    The phases are those of `force_limit_n`, which has no default: each names its own limit.
    Neither has `late_chunk`: it names every phase once.
    `maximum_age_s` and `recovery_plans` may name a `default` and the phases that differ from it,
    and an age may be one number; what is read back is complete, one entry per phase.

    Attributes:
        replan_lead_rows: Executable actions left at which the next invocation begins, so that its
            chunk is meant to take over with this row; one that begins behind it is late.
        late_chunk: Phases by what becomes of a late chunk.
        deadline_s: An invocation that takes longer has missed its deadline and is given up.
        term_deadlines: Of each latency term `[term, most s, action]`: what it may take, and what
            its owner does beyond that. All eleven or none; none where nobody times the terms, as
            by the wall clock, which knows whole answers.
        watchdog_s: Silence after which the stub holds; at least one period. Polled every period,
            the hold comes within `period + watchdog` (P2).
        queue_capacity: Chunks kept; the oldest is dropped beyond it.
        maximum_age_s: Largest action age by phase, less than the age of a chunk's last executable
            action on the controller's ticks (execution horizon minus one, times period), or it
            would refuse nothing; one number for all. A phase without one accepts nothing.
        maximum_divergence_m: Measured against commanded TCP, beyond which chunks are void.
        maximum_scene_shift_m: How far a body of the scene may be seen from where it stood when a
            chunk was checked; beyond it the chunk is void. The default is what perception shakes
            by: two frames with white noise of 5 mm differ by more in one of fifty.
        force_limit_n: Contact force by phase at which the simulated supervisor stops; a phase
            without one has limit 0. A fixture of the simulation, not a value for any robot.
        hold_before_recovery_s: Silence after which recovery begins.
        recovery_hold_s: Hold at the start of a recovery.
        primitive_timeout_s: Longest fallback primitive; one that takes longer has failed.
        human_timeout_s: How long recovery waits for a person before it aborts.
        maximum_failures: Failed primitives before it aborts, and recoveries begun after which it
            asks a person at once.
        recovery_plans: Primitives by phase, in order, each at most once; a phase without any holds
            and asks a person.
        silence_stop_s: Silence after which the supervisor stops; None: it holds, however long.
    """

    replan_lead_rows: int = Field(ge=0)
    late_chunk: dict[LateChunk, tuple[str, ...]]
    deadline_s: float = Field(gt=0)
    term_deadlines: dict[Term, TermDeadline] = Field(default_factory=dict)
    watchdog_s: float = Field(gt=0)
    queue_capacity: int = Field(ge=1)
    maximum_age_s: dict[str, NotNegative]
    maximum_divergence_m: NotNegative
    force_limit_n: dict[str, NotNegative]
    hold_before_recovery_s: NotNegative
    recovery_hold_s: NotNegative
    primitive_timeout_s: NotNegative
    human_timeout_s: NotNegative
    maximum_failures: int = Field(ge=1)
    recovery_plans: dict[str, tuple[RecoveryState, ...]]
    silence_stop_s: float | None = Field(default=None, gt=0)
    maximum_scene_shift_m: NotNegative = 0.02

    @model_validator(mode="before")
    @classmethod
    def _by_phase(cls, values: Any) -> Any:
        if not isinstance(values, dict) or not isinstance(values.get("force_limit_n"), dict):
            return values
        phases = list(values["force_limit_n"])
        complete = dict(values)
        for name in ("maximum_age_s", "recovery_plans"):
            table = complete.get(name)
            if name == "maximum_age_s" and not isinstance(table, dict):
                table = {DEFAULT: table}
            if isinstance(table, dict):
                complete[name] = _complete(name, table, phases)
        late = complete.get("late_chunk")
        if isinstance(late, dict):
            complete["late_chunk"] = _each_once(late, phases)
        rows = complete.get("term_deadlines")
        if isinstance(rows, list | tuple):
            complete["term_deadlines"] = _each_term(rows)
        plans = complete.get("recovery_plans")
        if isinstance(plans, dict):
            complete["recovery_plans"] = {phase: _plan(phase, plans[phase]) for phase in plans}
        return complete

    @field_serializer("term_deadlines")
    def _as_rows(self, table: dict[Term, TermDeadline]) -> list[tuple[str, float, str]]:
        """As `params.yaml` has it, so that what is written is read again."""
        return [(str(term), row.most_s, str(row.action)) for term, row in table.items()]

    @property
    def late_by_phase(self) -> dict[str, str]:
        """What becomes of a late chunk, by phase."""
        return {phase: str(what) for what, phases in self.late_chunk.items() for phase in phases}


@dataclass(frozen=True)
class Cell:
    """What every session runs under.

    Attributes:
        horizons: H_o, K, H_e and the period.
        execution: Settings of executor, stub, supervisor and recovery.
        controller_mode: The one mode of the controller in which an action may be accepted.

    Raises:
        ConfigError: A watchdog shorter than a period.
    """

    horizons: HorizonConfig
    execution: ExecutionSettings
    controller_mode: str = CONTROLLER_MODE

    def __post_init__(self) -> None:
        if not self.execution.watchdog_s >= self.horizons.action_period_s:
            raise ConfigError(
                where="execution.watchdog_s",
                found=f"{self.execution.watchdog_s} s",
                expected=f"at least one period, {self.horizons.action_period_s:g} s",
                action="Raise it: the watchdog would hold between any two actions.",
            )

    @cached_property
    def period_ns(self) -> int:
        """Time between actions, ns."""
        return to_ns(self.horizons.action_period_s)

    @property
    def watchdog_ns(self) -> int:
        """Silence after which the stub holds, ns."""
        return to_ns(self.execution.watchdog_s)

    @cached_property
    def maximum_age_ns(self) -> dict[str, int]:
        """Largest action age per phase, ns."""
        return {phase: to_ns(age) for phase, age in self.execution.maximum_age_s.items()}

    @cached_property
    def latest_first_row(self) -> dict[str, int]:
        """By phase, the row with which a chunk may begin at the latest."""
        last, lead = self.horizons.prediction_horizon - 1, self.execution.replan_lead_rows
        return {
            phase: last if what == LateChunk.CONTINUE else lead
            for phase, what in self.execution.late_by_phase.items()
        }

    def view_after(
        self, view: View, *, event_ns: int, phase: str, epoch: str, tcp_m: Position | None
    ) -> View:
        """A view of the present after an observation; a phase without limits allows nothing."""
        return replace(
            view,
            newest_observation_ns=event_ns,
            phase=phase,
            calibration_epoch=epoch,
            maximum_age_ns=self.maximum_age_ns.get(phase),
            latest_first_row=self.latest_first_row.get(phase),
            tcp_m=tcp_m,
        )

    def require_task(self, phases: Iterable[str]) -> None:
        """Refuse a cell that is not for this task, or whose age limits refuse nothing.

        Raises:
            ConfigError: A phase has no limits, limits are for a phase that does not exist, or no
                action can exceed an age limit: its chunk is void before.
        """
        limits_n = self.execution.force_limit_n
        if set(phases) != set(limits_n):
            raise ConfigError(
                where="execution.force_limit_n",
                found=f"phases {sorted(limits_n)}",
                expected=f"the task's: {sorted(phases)}",
                action="Name a force limit for each phase of the task and for no other.",
            )
        # Controllers accept at whole periods, so no valid action is older than its last row then.
        oldest_s = (self.horizons.execution_horizon - 1) * self.horizons.action_period_s
        for phase, age_s in self.execution.maximum_age_s.items():
            if not age_s < oldest_s - 1e-9:
                raise ConfigError(
                    where=f"execution.maximum_age_s of phase {phase}",
                    found=f"{age_s} s",
                    expected=f"less than {oldest_s:g} s, the age of a chunk's last valid action",
                    action="Lower it: a limit that nothing can exceed refuses nothing.",
                )

    def first_view(self) -> View:
        """The view of whoever is held to this, before anything is observed."""
        return View(
            fallback=FALLBACK_HASH,
            execution_horizon=self.horizons.execution_horizon,
            period_ns=self.period_ns,
            controller_mode=self.controller_mode,
            divergence_limit_m=self.execution.maximum_divergence_m,
            scene_limit_m=self.execution.maximum_scene_shift_m,
        )


def _complete(name: str, table: dict[str, Any], phases: list[str]) -> dict[str, Any]:
    """One entry per phase, from the phase's own or the default; a phase without either has none."""
    for phase in table:
        if phase != DEFAULT and phase not in phases:
            raise ConfigError(
                where=f"execution.{name}",
                found=f"the phase {phase!r}",
                expected=f"one of {phases} or {DEFAULT!r}",
                action="Name a phase that has a force limit.",
            )
    return {
        phase: table[phase] if phase in table else table[DEFAULT]
        for phase in phases
        if phase in table or DEFAULT in table
    }


def _each_once(late: dict[Any, Any], phases: list[str]) -> dict[LateChunk, tuple[str, ...]]:
    """Every phase in one of the lists, and in one only."""
    lists = {name: late[name] for name in late if isinstance(late[name], list | tuple)}
    named = [phase for listed in lists.values() for phase in listed]
    wrong = [f"{name!r}" for name in late if name not in [*LateChunk] or name not in lists]
    wrong += [f"no {phase}" for phase in phases if phase not in named]
    wrong += [f"{phase} twice" for phase in phases if named.count(phase) > 1]
    wrong += [f"the phase {phase!r}" for phase in named if phase not in phases]
    if wrong:
        raise ConfigError(
            where="execution.late_chunk",
            found=", ".join(wrong),
            expected=f"{', '.join(LateChunk)}: a list each, and each of {phases} in one of them",
            action="Say of every phase what becomes of a late chunk; nothing is assumed.",
        )
    return {LateChunk(name): tuple(listed) for name, listed in lists.items()}


def _each_term(rows: Iterable[Any]) -> dict[Term, TermDeadline]:
    """Every term in one row, with a time and an action that can be executed for it; or no row."""
    found: dict[Term, TermDeadline] = {}
    wrong: list[str] = []
    for row in rows:
        deadline = _deadline(row)
        if deadline is None:
            wrong.append(repr(row))
        elif Term(row[0]) in found:
            wrong.append(f"{row[0]} twice")
        else:
            found[Term(row[0])] = deadline
    wrong += [f"no {term}" for term in Term if found and term not in found]
    if wrong:
        raise ConfigError(
            where="execution.term_deadlines",
            found=", ".join(wrong)[:200],
            expected=f"[term, most s > 0, action] of each of {', '.join(Term)}; actions that fit: "
            + "; ".join(f"{what} ({', '.join(sorted(FITTING[what]))})" for what in DeadlineAction),
            action="Say of every term what it may take and what is done beyond it.",
        )
    return found


def _deadline(row: Any) -> TermDeadline | None:
    """A row of the table; None if it is no term, no time, or no action that fits the term."""
    if not isinstance(row, list | tuple) or len(row) != 3:
        return None
    term, most_s, action = row
    timed = isinstance(most_s, float) and 0.0 < most_s < math.inf
    if not timed or term not in [*Term] or action not in [*DeadlineAction]:
        return None
    if Term(term) not in FITTING[DeadlineAction(action)]:
        return None
    return TermDeadline(most_s, DeadlineAction(action))


def _plan(phase: str, names: Any) -> tuple[RecoveryState, ...]:
    """The primitives of a phase."""
    known = isinstance(names, list | tuple) and all(name in PRIMITIVES for name in names)
    if not known or len(set(names)) != len(names):
        raise ConfigError(
            where=f"execution.recovery_plans of phase {phase}",
            found=repr(names),
            expected=f"a list of {' and '.join(PRIMITIVES)}, each at most once",
            action="Correct it in params.yaml.",
        )
    return tuple(RecoveryState(name) for name in names)
