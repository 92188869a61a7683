"""The events of a session as a viewer's messages: what stood, moved, was proposed and refused.

Each topic says at every change all that it shows, once for a time, so that a viewer that jumps sees
what one that played sees. The arm is drawn where it was measured, which the journal of a
rollout states at every tick; where a session has no such states, where it was commanded to be.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, split_action
from genpolicy.contract.rotation import rotation_from_6d
from genpolicy.data.recording.wire import LOG_SCHEMA_NAME
from genpolicy.execution.journal import Event, decode_actions
from genpolicy.execution.moment import FALLBACK
from genpolicy.replay.bodies import DrawnCell, frame_of, poses_of, primitives
from genpolicy.replay.journal_file import Drawn
from genpolicy.replay.messages import (
    IDENTITY,
    JOINTS_SCHEMA_NAME,
    SCENE_SCHEMA_NAME,
    TRANSFORM_SCHEMA_NAME,
    Colour,
    Json,
    dots,
    entity,
    joints,
    letters,
    line,
    log,
    scene_update,
    solid,
    transform,
)
from genpolicy.replay.proposals import Proposals, RejectedProposal
from genpolicy.replay.words import said_of
from genpolicy.robot.outlines import Placed
from genpolicy.robot.scene_state import SceneState

Array = NDArray[np.float64]

SCENE, ROBOT, COMMANDED, RAW, PROJECTED, REJECTED = (
    f"/replay/{name}" for name in ("scene", "robot", "commanded", "raw", "projected", "rejected")
)
TRANSFORMS, LOG = "/replay/tf", "/replay/log"
JOINTS_COMMANDED, JOINTS_MEASURED = "/replay/joints/commanded", "/replay/joints/measured"
COMMANDED_FRAME, MEASURED_FRAME = "tcp_commanded", "tcp_measured"

INK: Colour = (0.1, 0.1, 0.1, 1.0)
BLUE: Colour = (0.0, 0.45, 0.70, 1.0)
SKY: Colour = (0.35, 0.70, 0.90, 0.8)
PURPLE: Colour = (0.80, 0.47, 0.65, 1.0)
ORANGE: Colour = (0.90, 0.60, 0.0, 0.9)
FAINT: Colour = (0.90, 0.60, 0.0, 0.4)
RED: Colour = (0.85, 0.15, 0.10, 1.0)
GLASS: Colour = (0.85, 0.15, 0.10, 0.25)
PATH_POINTS = 100
"""Commanded positions that are shown behind the newest: every message says all that it shows."""
DOT_M, MARK_M = 0.004, 0.012
ABOVE = np.array([0.0, 0.0, 0.03])
"""A text stands above its place, m."""


class Timeline:
    """What a session shows while its events go by.

    Args:
        cell: The task's cell.
        proposals: What was rejected.
        session: Name of the session.
    """

    def __init__(self, cell: DrawnCell, proposals: Proposals, session: str) -> None:
        self._cell, self._proposals, self._session = cell, proposals, session
        self._changed: dict[str, list[Json]] = {}
        self._logs: list[Json] = []
        self._frames: dict[str, tuple[Array, Array]] = {}
        self._joints: dict[str, Array] = {}
        self._bodies: Any = None
        self._scene = cell.scene(SceneState())
        self._chunks: dict[int, tuple[Mapping[str, Any], Array, Array | None]] = {}
        self._rejected: list[RejectedProposal] = []
        self._rejected_ns = -1
        self._path: deque[Array] = deque(maxlen=PATH_POINTS)
        self._at_m: Array | None = None
        self._holds = ""
        self._posed = self._measured = False

    def messages(self, events: Iterable[Event]) -> Iterator[Drawn]:
        """The messages of a session's events, in the order of time.

        Raises:
            KeyError, ValueError, TypeError, GenpolicyError: An event that cannot be read.
        """
        now_ns = 0
        self._show_scene(0, {})
        for event in events:
            time_ns = max(event.t, 0)
            if time_ns != now_ns:
                yield from self._flushed(now_ns)
                now_ns = time_ns
            self._take(event, time_ns)
        yield from self._flushed(now_ns)

    def _flushed(self, now_ns: int) -> Iterator[Drawn]:
        for topic, entities in self._changed.items():
            yield Drawn(topic, SCENE_SCHEMA_NAME, now_ns, scene_update(now_ns, entities))
        for frame, (position, rotation) in self._frames.items():
            content = transform(now_ns, frame, position, rotation)
            yield Drawn(TRANSFORMS, TRANSFORM_SCHEMA_NAME, now_ns, content)
        for topic, q_rad in self._joints.items():
            yield Drawn(topic, JOINTS_SCHEMA_NAME, now_ns, joints(now_ns, q_rad))
        for content in self._logs:
            yield Drawn(LOG, LOG_SCHEMA_NAME, now_ns, content)
        self._changed, self._logs, self._frames, self._joints = {}, [], {}, {}

    def _take(self, event: Event, now_ns: int) -> None:
        payload = event.payload
        match event.kind:
            case "scene":
                self._show_scene(now_ns, payload["bodies"])
            case "state":
                self._measure(now_ns, payload)
            case "candidate":
                self._judge(now_ns, payload)
            case "enqueue":
                self._propose(now_ns, payload)
            case "accept" | "fallback":
                self._command(now_ns, payload)
            case "discard" | "finish":
                self._chunks.pop(payload["arrival"], None)
        self._say(event, now_ns)

    def _say(self, event: Event, now_ns: int) -> None:
        """A line of the log; a hold that goes on for the same reason is said once."""
        reason = str(event.payload["reason"]) if event.kind == "hold" else ""
        if event.kind in ("hold", "accept", "fallback"):
            again, self._holds = reason == self._holds, reason
            if again or not reason:
                return
        found = said_of(event.kind, event.payload)
        if found is not None:
            level, text = found
            source = (self._session, event.n)
            self._logs.append(log(now_ns, level, text, name=event.kind, source=source))

    # -- what stands ----------------------------------------------------------------------------

    def _show_scene(self, now_ns: int, bodies: Mapping[str, str]) -> None:
        if bodies == self._bodies:
            return
        self._bodies = bodies
        self._scene = self._cell.scene(SceneState(poses_of(bodies)))
        entities = [entity("workspace", now_ns, lines=[frame_of(self._cell.workspace)])]
        self._changed[SCENE] = entities + self._entities(now_ns, self._scene)

    def _show_robot(self, now_ns: int, q_rad: Array, opening_m: float) -> None:
        self._posed = True
        placed = self._cell.robot(q_rad, opening_m)
        self._changed[ROBOT] = self._entities(now_ns, placed)

    def _measure(self, now_ns: int, payload: Mapping[str, Any]) -> None:
        q_rad, turned = np.array(payload["q_rad"]), np.array(payload["tcp_rotation"])
        self._measured = True
        self._show_robot(now_ns, q_rad, float(payload["gripper_m"]))
        self._joints[JOINTS_MEASURED] = q_rad
        self._frames[MEASURED_FRAME] = (np.array(payload["tcp_m"]), rotation_from_6d(turned))

    def _entities(self, now_ns: int, placed: Sequence[Placed]) -> list[Json]:
        """An entity of each shape, so that a click says which it is."""
        return [
            entity(
                f"{number} {one[0].name}", now_ns, facts=[("body", one[0].body)],
                **primitives([one], self._cell.look(one[0])),
            )
            for number, one in enumerate(placed)
        ]  # fmt: skip

    # -- what was proposed ----------------------------------------------------------------------

    def _propose(self, now_ns: int, payload: Mapping[str, Any]) -> None:
        actions, motion = decode_actions(payload["actions"]), payload["motion"]
        q_rad = None if motion is None else _joints(motion, "q_rad")
        self._chunks[payload["arrival"]] = (payload, actions, q_rad)
        if motion is not None and not self._measured:
            measured = _joints(motion, "q_meas_rad")[-1]
            self._joints[JOINTS_MEASURED] = measured
            if not self._posed:
                opening_m = float(decode_actions(motion["last_action"])[0, GRIPPER])
                self._show_robot(now_ns, measured, opening_m)
        look = PURPLE if payload["source"] == FALLBACK else BLUE
        raw = decode_actions(payload["raw"] or payload["actions"])[:, POSITION]
        away_mm = 1e3 * np.linalg.norm(raw - actions[:, POSITION], axis=1).max(initial=0.0)
        facts = [(name, str(payload[name])) for name in ("chunk_id", "method", "source", "phase")]
        facts.append(("moved by projection", f"at most {away_mm:.2f} mm"))
        self._changed[RAW] = [_chunk("raw", now_ns, raw, SKY, facts)]
        self._changed[PROJECTED] = [_chunk("projected", now_ns, actions[:, POSITION], look, facts)]

    def _command(self, now_ns: int, payload: Mapping[str, Any]) -> None:
        action = decode_actions(payload["action"])[0]
        position, rotation, opening = split_action(action)
        row = int(payload["row"])
        chunk, _, q_rad = self._chunks.get(payload["arrival"], ({}, None, None))
        if q_rad is not None:
            checked = row - int(chunk["checked_rows"][0])
            if 0 <= checked < len(q_rad):
                if not self._measured:
                    self._show_robot(now_ns, q_rad[checked], float(opening))
                self._joints[JOINTS_COMMANDED] = q_rad[checked]
        self._at_m, self._frames[COMMANDED_FRAME] = position, (position, rotation)
        self._path.append(position)
        text = f"{payload['chunk_id']} row {row}, age {payload['age_ns'] / 1e6:.0f} ms"
        self._changed[COMMANDED] = [
            entity("path", now_ns, lines=[line(np.array(self._path), INK)]),
            entity(
                "commanded", now_ns, facts=[("gripper opening, m", f"{float(opening):.4f}")],
                spheres=[solid(position, IDENTITY, np.full(3, MARK_M), INK)],
                lines=[line(np.array([position, position + 0.05 * rotation[:, 2]]), INK)],
                texts=[letters(position + ABOVE, text, INK)],
            ),
        ]  # fmt: skip

    # -- what was rejected ----------------------------------------------------------------------

    def _judge(self, now_ns: int, payload: Mapping[str, Any]) -> None:
        """The rejected candidates of one invocation; those of an earlier time are gone."""
        if now_ns != self._rejected_ns:
            self._rejected, self._rejected_ns = [], now_ns
            self._changed[REJECTED] = []
        found = self._proposals.rejected(payload)
        if found is None:
            return
        place = len(self._rejected)
        self._rejected.append(found)
        self._changed[REJECTED].append(self._refused(now_ns, found, place, payload["chunk_id"]))

    def _refused(self, now_ns: int, found: RejectedProposal, place: int, chunk_id: str) -> Json:
        """One rejected proposal: its way, the offending action, the tool there, and the reason."""
        name = f"rejected {place} {chunk_id} candidate {found.index}"
        facts = [
            ("layer", found.layer), ("reason", found.reason), ("action", str(found.row)),
            ("margin", f"{found.margin} {found.unit}"),
        ]  # fmt: skip
        parts: dict[str, list[Json]] = {"cubes": [], "cylinders": [], "spheres": [], "lines": []}
        where = self._nowhere()
        for actions, look in ((found.raw, FAINT), (found.projected, ORANGE)):
            points = _finite(actions)
            if len(points):
                parts["lines"].append(line(points, look))
                parts["spheres"] += dots(points, look, diameter_m=DOT_M)
                where = points[-1]
        offending = _offending(found)
        if offending is not None:
            position, rotation, opening = split_action(offending)
            where = position
            parts["spheres"].append(solid(position, IDENTITY, np.full(3, MARK_M), RED))
            if np.all(np.isfinite(rotation)):
                tool = self._cell.tool(position, rotation, float(opening))
                touched = [one for one in self._scene if one[0].name in found.touching]
                for placed in (*tool, *touched):
                    look = RED if placed[0].name in found.touching else GLASS
                    for kind, shapes in primitives([placed], look).items():
                        parts[kind] += shapes
        text = letters(where + ABOVE * (2 + place), found.said, RED)
        return entity(name, now_ns, facts=facts, texts=[text], **parts)

    def _nowhere(self) -> Array:
        """Where a text stands whose proposal nobody kept: at the last command, else on top."""
        if self._at_m is not None:
            return self._at_m
        low, high = np.array(self._cell.workspace.lower_m), np.array(self._cell.workspace.upper_m)
        return np.array([*(low[:2] + high[:2]) / 2, high[2]])


def _chunk(
    name: str, now_ns: int, points_m: Array, look: Colour, facts: Sequence[tuple[str, str]]
) -> Json:
    """The way of a chunk, with a dot at each of its actions (n, 3)."""
    return entity(
        name, now_ns, facts=facts, lines=[line(points_m, look)],
        spheres=dots(points_m, look, diameter_m=DOT_M),
    )  # fmt: skip


def _offending(found: RejectedProposal) -> Array | None:
    """The first offending action (10,), where it has a place."""
    actions = found.judged
    if actions is None or found.row is None or not 0 <= found.row < len(actions):
        return None
    action = actions[found.row]
    return action if np.all(np.isfinite(action)) else None


def _finite(actions: Array | None) -> Array:
    """Positions that are numbers. Shape (n, 3)."""
    if actions is None:
        return np.zeros((0, 3))
    points = actions[:, POSITION]
    return points[np.all(np.isfinite(points), axis=1)]


def _joints(motion: Mapping[str, Any], name: str) -> Array:
    """Joint positions of an `enqueue` event, rad. Shape (n, J)."""
    values = np.frombuffer(bytes.fromhex(motion[name]), dtype="<f8")
    return values.reshape(-1, int(motion["joints"]))
