"""The world of a rollout once more, under the commands that its journal says were accepted.

No policy, queue or check is run. At every tick what is recorded as commanded is commanded, what is
recorded as a push pushes, and the world goes on, as in a rollout. What the cell then measures of
itself, and what ends the rollout, is the world's.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION
from genpolicy.evidence.stress.measured import Measured
from genpolicy.evidence.stress.state import Outcome
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.journal import Journal
from genpolicy.execution.nanoseconds import to_ns
from genpolicy.execution.supervisor import Supervisor
from genpolicy.tasks.api import Task, World
from genpolicy.verification.journal_source import Message, floats, read_messages

Array = NDArray[np.float64]
Ended = tuple[int, Outcome]
"""The tick at which a world ends its rollout, and how."""

POSE = ("q_rad", "tcp_m", "tcp_rotation", "gripper_m")
"""What of a measured state says where the arm is."""
TURN = ("old", "new", "cause", "phase", "failures")
"""What an event of recovery says."""
FORCE = "force_n"
"""What of it says how hard something was touched in the period before, N."""


@dataclass(frozen=True)
class Turn:
    """Recovery goes from one state to another.

    Attributes:
        t: When, ns.
        old: From where.
        new: To where.
        cause: Why.
        phase: Phase of the task in which it began.
        failures: Primitives that have failed.
    """

    t: int
    old: str
    new: str
    cause: str
    phase: str
    failures: int


@dataclass(frozen=True)
class Recorded:
    """What a journal says of one rollout that its world, or its plan, can be asked about.

    Attributes:
        labels: What it says of itself, by name.
        commands: When something was accepted, ns, and what. Each of shape (D_a,).
        pushes: When the hand was pushed, ns, sideways by how much, N, and for how long, s; in
            their order.
        states: What was measured, by time, ns.
        turns: Where recovery went.
        overruns: When a term of an answer took too long, ns, and which, with what is done then.
        outcome: How it is said to have ended.
        end_ns: When.
    """

    labels: Mapping[str, str]
    commands: list[tuple[int, Array]] = field(default_factory=list)
    pushes: list[tuple[int, float, float]] = field(default_factory=list)
    states: dict[int, Message] = field(default_factory=dict)
    turns: list[Turn] = field(default_factory=list)
    overruns: list[tuple[int, str]] = field(default_factory=list)
    outcome: str = ""
    end_ns: int = 0

    def with_event(self, kind: str, payload: Message) -> "Recorded":
        """The same behind an event; of one kind a person's and recovery's commands are."""
        t = payload["t"]
        if kind in ("accept", "fallback"):
            self.commands.append((t, floats(payload["action"])))
        elif kind == "push":
            self.pushes.append((t, float(payload["force_n"]), float(payload["duration_s"])))
        elif kind == "state":
            self.states[t] = payload
        elif kind == "recovery":
            self.turns.append(Turn(t, *(payload[name] for name in TURN)))
        elif kind == "invocation" and payload["stage"] == "overrun":
            self.overruns.append((t, str(payload["detail"])))
        elif kind == "outcome":
            return replace(self, outcome=str(payload["outcome"]))
        elif kind == "end":
            return replace(self, end_ns=t)
        return self

    def ticks(self, period_s: float) -> int:
        """How many periods it lasted."""
        return round(self.end_ns / to_ns(period_s))

    def between_ticks(self, period_s: float) -> list[int]:
        """When something was commanded or pushed that no tick can stand for, ns.

        A tick commands once. It may push more than once: two pushes can fall due together.
        """
        times = {to_ns(tick * period_s) for tick in range(self.ticks(period_s))}
        found, left = [t for t, _, _ in self.pushes if t not in times], set(times)
        for t, _ in self.commands:
            if t not in left:
                found.append(t)
            left -= {t}
        return found


def recorded_rollouts(path: Path) -> dict[str, Recorded]:
    """The rollouts of a journal file, by session.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal.
        KeyError, TypeError, ValueError: An event that cannot be read.
    """
    found: dict[str, Recorded] = {}
    for kind, payload in read_messages(path):
        name = str(payload.get("session"))
        if kind == "session":
            found[name] = Recorded(dict(payload["labels"]))
        else:
            found[name] = found[name].with_event(kind, payload)
    return found


@dataclass(frozen=True)
class Played:
    """What a world did.

    Attributes:
        states: What was measured at each tick, as a journal states it, to the last.
        ended: When and how the world ended the rollout; None where it did not.
    """

    states: Sequence[Mapping[str, Any]]
    ended: Ended | None


def play(
    world: World,
    recorded: Recorded,
    *,
    task: Task,
    execution: ExecutionSettings,
    period_s: float,
    moved_m: float = 0.0,
) -> Played:
    """Command what was recorded until the world or the supervisor ends it, or nothing is left.

    Args:
        world: At rest at the start of the rollout.
        recorded: The rollout.
        task: Whose world it is.
        execution: Limits of the supervisor.
        period_s: Between two ticks, s.
        moved_m: Every commanded position is moved by as much along each axis, m.

    Raises:
        NonFiniteError: A command is no action.
    """
    journal = Journal("played again")
    supervisor, measured = Supervisor(execution, journal), Measured(task, world, journal)
    commands = dict(recorded.commands)
    pushes: dict[int, list[tuple[float, float]]] = defaultdict(list)
    for t, force_n, duration_s in recorded.pushes:
        pushes[t].append((force_n, duration_s))
    states: list[Mapping[str, Any]] = []
    ticks = recorded.ticks(period_s)
    for tick in range(ticks + 1):
        now_s = tick * period_s
        measured.note(now_s)
        states.append(journal.last("state") or {})
        how = _ends(world, supervisor, now_s, begun=tick > 0)
        if how is not None:
            return Played(states, (tick, how))
        if tick == ticks:
            break
        for force_n, duration_s in pushes.get(to_ns(now_s), ()):
            world.apply_force(np.array([0.0, force_n, 0.0]), duration_s)
        action = commands.get(to_ns(now_s))
        if action is None:
            world.hold()
        else:
            moved = action.copy()
            moved[POSITION] += moved_m
            world.command(moved)
        world.advance()
    return Played(states, None)


def _ends(world: World, supervisor: Supervisor, now_s: float, *, begun: bool) -> Outcome | None:
    """What ends a rollout at a tick; its last period is supervised before it succeeds."""
    if supervisor.observe_collision(now_s, world.collision):
        return Outcome.COLLISION
    if supervisor.observe_force(now_s, world.contact_force_n, world.phase):
        return Outcome.FORCE_STOP
    return Outcome.SUCCESS if begun and world.success else None
