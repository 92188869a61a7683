"""What a question of `execution/checks.py` is asked about: a chunk, at a moment, in a view.

All times are whole nanoseconds; a fact that the asking place does not know is None.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import NamedTuple

from genpolicy.contract.chunk import ChunkMetadata, DiscardReason
from genpolicy.execution.nanoseconds import NEVER_NS, ChunkTimes
from genpolicy.execution.scene import Scene

Position = tuple[float, float, float]
POLICY = "policy"
FALLBACK = "fallback"


class ExecutorMode(StrEnum):
    """Who commands."""

    RUN = "run"
    FALLBACK = "fallback"
    INTERVENTION = "intervention"
    ENDED = "ended"


MODE_OF_SOURCE = {POLICY: ExecutorMode.FALLBACK, FALLBACK: ExecutorMode.RUN}
"""In which mode the other source commands, so that chunks of this one are refused."""


class Voiding(NamedTuple):
    """An event after which nothing from before it may be used.

    Attributes:
        before_ns: What was conditioned before this time is void, and so is what was checked from
            joints that were measured before it.
        arrivals: What arrived with a smaller number is void too; it was there at the event.
    """

    before_ns: int = NEVER_NS
    arrivals: int = 0


@dataclass(frozen=True, slots=True)
class View:
    """The present, as the asking place knows it.

    Attributes:
        phase: Task phase of the newest observation; empty before the first.
        calibration_epoch: Calibration of the newest observation.
        newest_observation_ns: Event time of the newest observation; None before the first.
        maximum_age_ns: Largest action age in this phase; None where no age is allowed.
        latest_first_row: Row with which a chunk may begin at the latest in this phase; None where
            none may.
        checkpoint: Active weights of the policy.
        sampler: Active sampler settings.
        fallback: Identity of the task's fallback planner, in place of both.
        session_epoch: Number of resets.
        mode: Who commands.
        stopped: Whether the supervisor stops.
        voidings: Per reason, the event that voided last.
        execution_horizon: Actions of a chunk that may be executed.
        period_ns: Time between actions.
        controller: Mode that the controller says it is in; empty before it said one.
        controller_mode: The mode that it must be in.
        divergence_limit_m: Measured from commanded TCP, beyond which chunks are void.
        scene: Where bodies were seen last; None until somebody says, and where it cannot be read.
        scene_limit_m: How far they may stand from where a chunk was checked with them.
        tcp_m: Where the newest observation measured the TCP, m; None where it does not say.
    """

    phase: str = ""
    calibration_epoch: str = ""
    newest_observation_ns: int | None = None
    maximum_age_ns: int | None = None
    latest_first_row: int | None = None
    checkpoint: str = ""
    sampler: str = ""
    fallback: str = ""
    session_epoch: int = 0
    mode: str = ExecutorMode.RUN
    stopped: bool = False
    voidings: Mapping[DiscardReason, Voiding] = field(default_factory=dict)
    execution_horizon: int = 0
    period_ns: int = 0
    controller: str = ""
    controller_mode: str = ""
    divergence_limit_m: float = 0.0
    scene: Scene | None = None
    scene_limit_m: float = 0.0
    tcp_m: Position | None = None

    def ignores(self, event_ns: int, now_ns: int) -> str:
        """Why an observation of this event time is not used now; empty where it is.

        `future`: it has not happened yet. `older`: than the newest one; an equal one is used.
        """
        if event_ns > now_ns:
            return "future"
        newest_ns = self.newest_observation_ns
        return "older" if newest_ns is not None and event_ns < newest_ns else ""

    def voided(self, reason: DiscardReason, before_ns: int, arrivals: int = 0) -> "View":
        """The view after an event; a later event of the same reason covers an earlier one."""
        old = self.voidings.get(reason, Voiding())
        new = Voiding(max(before_ns, old.before_ns), max(arrivals, old.arrivals))
        return self if new == old else replace(self, voidings={**self.voidings, reason: new})


@dataclass(frozen=True, slots=True)
class Chunk:
    """What is asked about.

    Attributes:
        metadata: Who made it, for what.
        times: Its times.
        source: policy or fallback.
        arrival: Its number among the arrivals.
        rows: Its number of actions, K.
        checked_rows: First row that feasibility checked, and the row behind the last one.
        passed: All six layers passed and all actions are finite.
        hashed: The actions have the hash that was taken when they passed.
        scene: Where bodies stood when it was checked; None where it does not say.
        measured_ns: When the joints were measured that it was checked from; before everything
            where it does not say.
    """

    metadata: ChunkMetadata
    times: ChunkTimes
    source: str = POLICY
    arrival: int = 0
    rows: int = 0
    checked_rows: tuple[int, int] = (0, 0)
    passed: bool = False
    hashed: bool = False
    scene: Scene | None = None
    measured_ns: int = NEVER_NS


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """One question: a chunk, or one row of it, at one time, in one view of the present.

    Attributes:
        now_ns: Time.
        view: The present.
        about: The chunk; None at the door and for the supervisor.
        first_use_ns: When its first action can be used; age and validity are asked for then, since
            a chunk that will be too old when it begins is too old now.
        row: The row in question.
        known: A chunk of this name was here before.
        issued: Feasibility made this very object, and its actions are unchanged.
        same_action: The offered action is the admitted row, bit for bit.
        head: Chunk that the next one may name as predecessor.
        accepted_condition_ns: Observation under the action accepted last; None before the first.
        accepted_start_ns: Start of that action's chunk.
        queued_condition_ns: Newest observation under a waiting chunk; None if none waits.
        queued_start_ns: Latest start of a waiting chunk.
        waiting: Chunks that wait.
        capacity: Chunks that may.
        newer_start_ns: Earliest start of a chunk that arrived after this one.
        last_due_ns: Begin of the window of the action accepted last.
        sequence: Number of the offer.
        last_sequence: Number of the offer accepted last.
        last_accept_ns: When an action was accepted last; None before the first.
        follows: The way from the last command to this row is one that feasibility checked; where no
            command says where the arm is, the way from where it was seen.
        watchdog_ns: Longest silence.
        divergence_m: What an observation says that the measured TCP is off the commanded one; None
            where it does not say, as of a replay without an arm.
    """

    now_ns: int
    view: View = View()
    about: Chunk | None = None
    first_use_ns: int | None = None
    row: int | None = None
    known: bool | None = None
    issued: bool | None = None
    same_action: bool | None = None
    head: str | None = None
    accepted_condition_ns: int | None = None
    accepted_start_ns: int | None = None
    queued_condition_ns: int | None = None
    queued_start_ns: int | None = None
    waiting: int = 0
    capacity: int = 0
    newer_start_ns: int | None = None
    last_due_ns: int | None = None
    sequence: int | None = None
    last_sequence: int = -1
    last_accept_ns: int | None = None
    follows: bool | None = None
    watchdog_ns: int = 0
    divergence_m: float | None = None

    @property
    def chunk(self) -> Chunk:
        """The chunk in question."""
        assert self.about is not None, "this place has no chunk to ask about"
        return self.about

    @property
    def due_ns(self) -> int:
        """Begin of the window of the row in question."""
        assert self.row is not None, "this place has no row to ask about"
        return self.chunk.times.due_ns(self.row)
