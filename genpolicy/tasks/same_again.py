"""Whether a task does the same again: asked before anything is recorded or trained.

Gate D begins each start with every method, and `verify report` plays recorded commands again. Of a
world that draws from elsewhere than its start, or keeps something of the world before it, neither
can be believed, and both would be told weeks behind its first recording. So one start is played in
several worlds, and held to what rollouts are held to: right behind itself, in a world that stood
there while another start was played and pushed, and in a fresh one behind that. At rest all of it
must be the same to the bit, as matched starts are asked for.

What differs in a probe only, or in a contact that these commands do not make, is not found.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER
from genpolicy.data.recording.episode import ACTION_STREAM
from genpolicy.errors import BadInputError
from genpolicy.seeds import stream
from genpolicy.tasks.api import Start, Task, World, WorldSettings

Array = NDArray[np.float64]

FREE = 1e-5
"""Of a state before anything touches, m, rad or without unit: it has six decimals, and ten times
what commands 1e-7 m beside it move it by (`gates.rederive_outcomes`)."""
IN_CONTACT = 1e-4
"""The same from the first contact on: thirty times what 1e-7 moved it by."""
FORCE_N = 0.1
"""Of a force, N: sixteen times what 1e-7 moved it by."""

NAME = "the same again"
FEW_TICKS = 20
"""Of the plays that ask what one world keeps of another: it shows at once, or in a whole one."""
PUSH_N, PUSH_S = 5.0, 0.2
"""Of the other start, sideways and at once."""
PLAN = "classical_return"
"""The task's plan back to the start region, which recovery may ask of any task."""
BEHIND_ITSELF = "a second time"
BESIDE = "in a world that was made before another start was played"
BEHIND = "in a fresh world behind another start"


@dataclass(frozen=True)
class Moment:
    """What a world is at a tick.

    Attributes:
        pose: Where the arm is, by what it is called, m, rad or without unit.
        force_n: The largest contact force of the period before, N.
        words: Its phase, and whether it has collided or succeeded.
    """

    pose: dict[str, Array]
    force_n: float
    words: str


@dataclass(frozen=True)
class Played:
    """What a world showed.

    Attributes:
        rest: Its state at rest, by hash.
        observed: What it observes there. Shape (D_o,).
        moments: At rest, and behind each command.
    """

    rest: str
    observed: Array
    moments: Sequence[Moment]


def require_same_again(task: Task, *, period_s: float, demonstrates: bool) -> None:
    """Require of a task that the same start and commands do the same, whatever was before.

    Args:
        task: The task.
        period_s: Between two commands, s.
        demonstrates: Whether the task records itself. Then its first demonstration is played;
            else its classical plan back to the start region.

    Raises:
        BadInputError: They do not.
    """
    other, once_more = (task.sample_start(stream(0, NAME, task.name)) for _ in range(2))
    if other.to_json() != once_more.to_json():
        raise BadInputError(
            where=f"the task {task.name}: sample_start, twice with the same generator",
            found=once_more.to_json(),
            expected=other.to_json(),
            action="Draw the start from the generator that is handed over, and from nothing else.",
        )
    start, actions = _demonstrated(task) if demonstrates else _planned(task, other)
    few = actions[:FEW_TICKS]
    first = _play(task, _world(task, start), actions)
    _hold(task, first, _play(task, _world(task, start), few), BEHIND_ITSELF, period_s)
    beside = _world(task, start)
    elsewhere = _world(task, task.sample_start(stream(0, NAME, task.name, "another")))
    elsewhere.apply_force(np.array([0.0, PUSH_N, 0.0]), PUSH_S)
    _play(task, elsewhere, few)
    _hold(task, first, _play(task, beside, few), BESIDE, period_s)
    _hold(task, first, _play(task, _world(task, start), actions), BEHIND, period_s)


def _demonstrated(task: Task) -> tuple[Start, Sequence[Array]]:
    (spec,) = task.episode_specs(0, 1)
    episode = task.record_episode(spec)
    return spec.start, list(episode.streams[ACTION_STREAM].values)


def _planned(task: Task, start: Start) -> tuple[Start, Sequence[Array]]:
    return start, list(task.fallback(_world(task, start), PLAN))


def _world(task: Task, start: Start) -> World:
    return task.make_world(start, settings=WorldSettings(task.calibration_epochs[-1]))


def _play(task: Task, world: World, actions: Sequence[Array]) -> Played:
    """Command one action a period, whatever comes of it."""
    rest, observed = world.state_sha256(), world.observe().copy()
    moments = [_moment(task, world)]
    for action in actions:
        world.command(action)
        world.advance()
        moments.append(_moment(task, world))
    return Played(rest, observed, moments)


def _moment(task: Task, world: World) -> Moment:
    position_m, rotation = world.tcp_pose
    pose = {
        "q_rad": np.array(world.q_meas),
        "tcp_m": np.array(position_m),
        "tcp_rotation": np.array(rotation),
        "gripper_m": np.array(task.action_at(world.observe())[GRIPPER]),
    }
    ends = [f", {name}" for name in ("collision", "success") if getattr(world, name)]
    return Moment(pose, float(world.contact_force_n), f"{world.phase}{''.join(ends)}")


def _hold(task: Task, first: Played, again: Played, how: str, period_s: float) -> None:
    """Require of a play that it is the first one once more, as far as it goes."""
    place = f"the task {task.name}: the same start and commands {how}"
    if first.rest != again.rest:
        _refuse(place, f"at rest in the state {again.rest[:16]}…", f"{first.rest[:16]}…")
    if not np.array_equal(first.observed, again.observed, equal_nan=True):
        off = _off(first.observed, again.observed)
        _refuse(place, f"observed at rest up to {off:.3g} beside it", "the same numbers")
    touches = False
    for tick, (one, other) in enumerate(zip(first.moments, again.moments, strict=False)):
        touches = touches or one.force_n > 0.0
        limit, when = IN_CONTACT if touches else FREE, f"at {tick * period_s:.3f} s:"
        for name, value in one.pose.items():
            off = _off(value, other.pose[name])
            if not off <= limit:
                _refuse(place, f"{when} {name} up to {off:.3g} beside it", f"within {limit:g}")
        if not abs(one.force_n - other.force_n) <= FORCE_N:
            within = f"{one.force_n:.3g} N, within {FORCE_N}"
            _refuse(place, f"{when} a force of {other.force_n:.3g} N", within)
        if one.words != other.words:
            _refuse(place, f"{when} {other.words}", one.words)


def _off(one: Array, other: Array) -> float:
    return float(np.max(np.abs(one - other))) if one.shape == other.shape else np.inf


def _refuse(place: str, found: str, expected: str) -> NoReturn:
    raise BadInputError(
        where=place,
        found=found,
        expected=expected,
        action="Draw what is random from the start and from `WorldSettings.seed` alone, share "
        "nothing between two worlds, and let neither a clock nor threads decide: rollouts of "
        "this task could not be played again, and no verdict on them would stand.",
    )
