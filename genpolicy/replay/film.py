"""A rollout as a film: where hand and scene stood, ten times a second, with force and age.

Everything is read from the session's journal. The hand stands where it was measured, as in a
replay; where a session states nothing measured, where it was commanded to be.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION
from genpolicy.contract.rotation import rotation_from_6d
from genpolicy.execution.journal import Event, decode_actions, encode_actions
from genpolicy.execution.nanoseconds import NS_PER_S
from genpolicy.replay.bodies import DrawnCell, poses_of
from genpolicy.robot.outlines import outlines
from genpolicy.robot.scene_state import SceneState
from genpolicy.robot.shapes import HELD

Array = NDArray[np.float64]
Outline = tuple[Array, Array]
"""Corners from above (n, 2) and from the side (m, 2), m, in the base frame."""

PERIOD_S = 0.1
COMMANDS = ("accept", "fallback")
OBSTACLE, TARGET, SURROUNDINGS = "obstacle", "target", "scene"


@dataclass(frozen=True)
class Frame:
    """What stood where at one moment.

    Attributes:
        hand: Outline of the tool; None before it was measured or commanded first.
        held: Outline of what it holds; None where it holds nothing.
        scene: Kind and outline of each shape of the scene.
    """

    hand: Outline | None
    held: Outline | None
    scene: tuple[tuple[str, Outline], ...]


@dataclass(frozen=True)
class Film:
    """One session.

    Attributes:
        frames: Every `PERIOD_S` from the beginning.
        path_m: Commanded positions of the TCP. Shape (n, 3).
        duration_s: From the first to the last event.
        forces: Time, s, and measured force, N, at each tick with one; without states each new peak.
        ages: Time, s, and age of what conditioned the action that was accepted then, s.
        phases: Time, s, and name of each phase that began.
        modes: Time, s, and who commands from then on: `run`, `fallback`, `intervention`, ...
    """

    frames: tuple[Frame, ...]
    path_m: Array
    duration_s: float
    forces: tuple[tuple[float, float], ...]
    ages: tuple[tuple[float, float], ...]
    phases: tuple[tuple[float, str], ...]
    modes: tuple[tuple[float, str], ...]


@dataclass
class _Seen:
    """What the events have said so far."""

    bodies: Mapping[str, str] = field(default_factory=dict)
    hand: str = ""


def film_of(cell: DrawnCell, events: Sequence[Event]) -> Film:
    """The film of a session's events.

    Args:
        cell: The task's cell.
        events: Of one session, in order.

    Raises:
        KeyError, ValueError, TypeError, GenpolicyError: An event that cannot be read.
    """
    commands = [event for event in events if event.kind in COMMANDS]
    path = [decode_actions(event.payload["action"])[0, POSITION] for event in commands]
    return Film(
        frames=tuple(_frames(cell, events)),
        path_m=np.array(path).reshape(-1, 3),
        duration_s=max(event.t for event in events) / NS_PER_S,
        forces=tuple(
            (e.t / NS_PER_S, float(e.payload["force_n"]))
            for e in _of(events, "state") or _of(events, "force")
            if e.payload["force_n"] > 0
        ),
        ages=tuple((e.t / NS_PER_S, e.payload["age_ns"] / NS_PER_S) for e in _of(events, "accept")),
        phases=tuple((e.t / NS_PER_S, str(e.payload["new"])) for e in _of(events, "phase")),
        modes=tuple((e.t / NS_PER_S, str(e.payload["new"])) for e in _of(events, "mode")),
    )


def _of(events: Sequence[Event], kind: str) -> list[Event]:
    return [event for event in events if event.kind == kind]


def _frames(cell: DrawnCell, events: Sequence[Event]) -> Iterator[Frame]:
    last_ns = max(event.t for event in events)
    step_ns = round(PERIOD_S * NS_PER_S)
    seen, place = _Seen(), 0
    measured = bool(_of(events, "state"))
    drawn: dict[Any, Any] = {}  # what stands still is drawn once
    for now_ns in [*range(0, last_ns, step_ns), last_ns]:
        while place < len(events) and events[place].t <= now_ns:
            event = events[place]
            if event.kind == "scene":
                seen.bodies = event.payload["bodies"]
            elif event.kind == "state":
                seen.hand = _pose_of(event.payload)
            elif event.kind in COMMANDS and not measured:
                seen.hand = event.payload["action"]
            place += 1
        scene = tuple(sorted(seen.bodies.items()))
        if scene not in drawn:
            drawn[scene] = _scene(cell, seen.bodies)
        if seen.hand not in drawn:
            drawn[seen.hand] = _hand(cell, seen.hand)
        hand, held = drawn[seen.hand]
        yield Frame(hand, held, drawn[scene])


def _scene(cell: DrawnCell, bodies: Mapping[str, str]) -> tuple[tuple[str, Outline], ...]:
    target = cell.collision.shapes.target_body
    kinds = {target: TARGET} | dict.fromkeys(cell.obstacles, OBSTACLE)
    return tuple(
        (kinds.get(placed[0].body, SURROUNDINGS), outlines([placed]))
        for placed in cell.scene(SceneState(poses_of(bodies)))
    )


def _pose_of(state: Mapping[str, Any]) -> str:
    """Pose and opening of a measured state, written as an action is."""
    numbers = [*state["tcp_m"], *state["tcp_rotation"], state["gripper_m"]]
    return encode_actions(np.array(numbers))


def _hand(cell: DrawnCell, pose: str) -> tuple[Outline | None, Outline | None]:
    if not pose:
        return None, None
    action = decode_actions(pose)[0]
    rotation = rotation_from_6d(action[ROTATION])
    placed = list(cell.tool(action[POSITION], rotation, float(action[GRIPPER])))
    hand = [one for one in placed if one[0].name != HELD]
    held = [one for one in placed if one[0].name == HELD]
    return outlines(hand), outlines(held) if held else None
