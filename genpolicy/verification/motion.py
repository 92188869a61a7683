"""Feasibility of executed rows, proved again with MuJoCo's kinematics and contacts.

It believes no layer. The journal says from which commands a chunk went on, where the scene stood
and which joint positions its rows have; that these joint positions are the poses that were
executed is checked first, and then they are held against the robot's limits, the scene and the
robot's own body, the way to them too; the first step also against where the arm was measured.
What may be done with a held object is `contact`'s.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from genpolicy.verification.body import Driven, OwnBody
from genpolicy.verification.branch import jumped
from genpolicy.verification.contact import ROUNDING, ExpectedContact
from genpolicy.verification.journal_source import Message, floats
from genpolicy.verification.pose import GRIPPER, POSITION, ROTATION, angle_rad, turned_by
from genpolicy.verification.projected import ExpectedProjection

Array = NDArray[np.float64]
Finding = tuple[str, str]

HELD, SCENE = 2, 3  # geom groups of a scene file; 1 is the robot's
POSE_TOLERANCE_M = POSE_TOLERANCE_RAD = 1e-5  # ten times what feasibility lets a pose be missed by
RATES = ("speed", "acceleration", "jerk")
TORQUE_TOLERANCE_NM = 1e-6
CONTACT_TOLERANCE_M = 1e-4  # less than this deep, two libraries may disagree whether shapes touch
MOST_PIECES = 1000  # no arm turns 20 rad in a row; whoever writes that shall not keep us busy
SWEPT_RAD = 0.02  # no joint turns further between two looks at the way: 16 mm at 0.8 m from it


@dataclass(frozen=True)
class ExpectedMotion:
    """What every executed row must keep to, as the caller knows it.

    Attributes:
        scene_path: MJCF of robot and scene: the arm's joints first, a site `tcp` behind them.
        workspace_m: Lower and upper corner of the box of the TCP, m. Shape (2, 3).
        rates: What commands of each joint may do: velocity, acceleration, jerk, rad and s.
            Shape (3, J).
        arm_rates: Velocity and acceleration that each joint has, rad and s. Shape (2, J).
        torque_nm: What each joint can bear. Shape (J,).
        tcp_speed_m_s: What the TCP may do.
        tcp_turn_rad_s: Likewise.
        joint_margin_rad: What joints keep off the ends of their ranges.
        branch_rad: What a joint may turn, from a command to the next, for no motion of the TCP.
        condition: Largest over smallest singular value that the TCP's Jacobian may have.
        held_opening_m: Above this opening nothing is held.
        contact: What touching the target must keep to.
        projection: What may be made of a chunk before it is admitted.
        seen: Pose of the TCP and opening, as an action (10,), that an observation (D_o,) shows;
            None: what was seen is not held against what was measured.
        placed: Bodies that it shows, by name; None: likewise of the scene on record.
    """

    scene_path: Path
    workspace_m: Array
    rates: Array
    arm_rates: Array
    torque_nm: Array
    tcp_speed_m_s: float
    tcp_turn_rad_s: float
    joint_margin_rad: float
    branch_rad: float
    condition: float
    held_opening_m: float
    contact: ExpectedContact
    projection: ExpectedProjection
    seen: Callable[[Array], Array] | None = None
    placed: Callable[[Array], Mapping[str, tuple[ArrayLike, ArrayLike]]] | None = None


class MotionProof:
    """Proves rows; holds one MuJoCo model, and of each session the action accepted last.

    Args:
        expected: What every row must keep to.
    """

    def __init__(self, expected: ExpectedMotion) -> None:
        self.expected = expected
        self._model: Any = mujoco.MjModel.from_xml_path(str(expected.scene_path))
        self._data: Any = mujoco.MjData(self._model)
        self._joints = len(expected.torque_nm)
        model = self._model
        self._tcp = int(model.site("tcp").id)
        sites = {model.site(i).name: i for i in range(model.nsite)}
        self._target_site = sites.get("target", -1)
        known = self._target_site >= 0
        self._target = int(model.site_bodyid[self._target_site]) if known else -1
        slides = model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
        self._slides = model.jnt_qposadr[slides].tolist()
        self._weld = next(
            (i for i in range(model.neq) if model.eq_type[i] == mujoco.mjtEq.mjEQ_WELD), None
        )
        self._own = OwnBody(model, self._joints, self._weld)
        self._driven = Driven(expected.scene_path, self._joints)
        self._loaded = Driven(expected.scene_path, self._joints, held=True)
        colliding = (model.geom_contype | model.geom_conaffinity) != 0
        self._held = np.flatnonzero(colliding & (model.geom_group == HELD))
        sizes = model.geom_size[self._held]
        self._held_width_m = float(sizes.min()) if sizes.size else 0.0
        self._last: dict[str, Array] = {}

    def forget(self, session: str) -> None:
        """Somebody else moved the arm: the next row has no executed row before it."""
        self._last.pop(session, None)

    def forward(self, q_rad: Array) -> tuple[Array, Array]:
        """Position (3,), m, and rotation (3, 3) of the TCP from joint positions (J,), rad."""
        self._data.qpos[: self._joints] = q_rad
        mujoco.mj_kinematics(self._model, self._data)
        rotation = self._data.site_xmat[self._tcp].reshape(3, 3)
        return self._data.site_xpos[self._tcp].copy(), rotation.copy()

    def objections(
        self, session: str, chunk: Message, row: int, *, phase: str, period_s: float
    ) -> Iterator[Finding]:
        """What is wrong with an executed row of a chunk; nothing if it is feasible.

        Args:
            session: Name of the session.
            chunk: Its `enqueue` event; it says what the chunk was checked against.
            row: Which row was accepted.
            phase: Task phase at the time.
            period_s: The controller's period, s.
        """
        motion = chunk["motion"]
        joints, (first, last) = self._joints, chunk["checked_rows"]
        path = floats(motion["q_rad"])
        q_cmd, told = floats(motion["q_cmd_rad"]), floats(motion["last_action"])
        if motion["joints"] != joints or path.size != (last - first) * joints:
            yield "P6.ground", f"{chunk['chunk_id']!r} has not {last - first} x {joints} joints."
            return
        if not first <= row < last:
            return  # a violation of its own (P1.checked_rows)
        before_rad = floats(motion["q_before_rad"]).reshape(-1, joints)
        path = np.concatenate([before_rad, q_cmd[None], path.reshape(-1, joints)])
        actions = floats(chunk["actions"]).reshape(chunk["rows"], -1)
        action = actions[row]
        before = self._last.get(session, actions[row - 1] if row > first else told)
        self._last[session] = action
        place = len(before_rad) + row - first + 1
        openings = np.concatenate([told[GRIPPER][None], actions[first : row + 1, GRIPPER]])
        held = bool(np.all(openings <= self.expected.held_opening_m))
        ends = path[place - 1 : place + 1]
        yield from jumped(self._model, self._data, self._tcp, ends, self.expected.branch_rad)
        self._pose(path[place], float(action[GRIPPER]), held, motion["scene"])
        yield from self._reached(action)
        yield from self._within(path[place], action, before, period_s)
        yield from self._turning_freely()
        loaded = bool(np.all(openings[:-1] <= self.expected.held_opening_m))
        yield from self._rates(path[: place + 1], period_s, loaded=loaded)
        if row == first:
            yield from self._from_measured(chunk, ends, period_s)
        yield from self._touching(held, phase)
        contact = self.expected.contact
        if held and phase in contact.phases:
            yield from contact.coming(action[POSITION] - before[POSITION], period_s)
        if loaded and not held:
            yield from contact.letting_go(phase, self._depth_m())
        scene = motion["scene"]
        yield from self._swept(ends, openings[-2:], held, phase, scene)
        if row == first:
            for sentence in self._on_the_way_here(chunk, before_rad, float(told[GRIPPER]), phase):
                yield "P6.measured_sweep", f"From where the arm was measured: {sentence}"

    def _pose(self, q_rad: Array, opening_m: float, held: bool, scene: dict[str, str]) -> None:
        model, data = self._model, self._data
        mujoco.mj_resetData(model, data)
        data.qpos[: self._joints] = q_rad
        data.qpos[self._slides] = max(opening_m, self._held_width_m if held else 0.0)
        for name, text in scene.items():
            body, pose = int(model.body(name).id), floats(text)
            mocap = int(model.body_mocapid[body])
            positions, turns, index = (
                (data.mocap_pos, data.mocap_quat, mocap)
                if mocap >= 0
                else (model.body_pos, model.body_quat, body)
            )
            positions[index], turns[index] = pose[:3], pose[3:]
        mujoco.mj_kinematics(model, data)
        if held and self._weld is not None:
            self._grasp()
        mujoco.mj_collision(model, data)

    def _grasp(self) -> None:
        """Put the held object where the weld has it in the hand."""
        model, data = self._model, self._data
        hand, body = int(model.eq_obj1id[self._weld]), int(model.eq_obj2id[self._weld])
        values = model.eq_data[self._weld]  # anchor on the object, position and turn in the hand
        turn, position, anchor = np.zeros(4), np.zeros(3), np.zeros(3)
        mujoco.mju_mulQuat(turn, data.xquat[hand], values[6:10])
        mujoco.mju_rotVecQuat(position, values[3:6], data.xquat[hand])
        mujoco.mju_rotVecQuat(anchor, values[:3], turn)
        address = int(model.jnt_qposadr[model.body_jntadr[body]])
        data.qpos[address : address + 3] = data.xpos[hand] + position - anchor
        data.qpos[address + 3 : address + 7] = turn
        mujoco.mj_kinematics(model, data)

    def _reached(self, action: Array) -> Iterator[Finding]:
        away_m = float(np.linalg.norm(self._data.site_xpos[self._tcp] - action[POSITION]))
        rotation = self._data.site_xmat[self._tcp].reshape(3, 3)
        turned = float(angle_rad(rotation, turned_by(action[ROTATION])))
        if not (away_m <= POSE_TOLERANCE_M and turned <= POSE_TOLERANCE_RAD):
            yield "P6.pose", f"Its joints are {away_m:.3g} m and {turned:.3g} rad off its pose."

    def _within(
        self, q_rad: Array, action: Array, before: Array, period_s: float
    ) -> Iterator[Finding]:
        expected, limits = self.expected, self._model.jnt_range[: self._joints].T
        lower, upper = expected.workspace_m
        if not np.all((action[POSITION] >= lower - 1e-9) & (action[POSITION] <= upper + 1e-9)):
            yield "P6.workspace", f"The TCP goes to {action[POSITION].tolist()} m."
        inner = limits[0] + expected.joint_margin_rad, limits[1] - expected.joint_margin_rad
        if not np.all((q_rad >= inner[0] - 1e-9) & (q_rad <= inner[1] + 1e-9)):
            yield "P6.joint_limit", f"The joints go to {q_rad.tolist()} rad."
        speed = float(np.linalg.norm(action[POSITION] - before[POSITION])) / period_s
        if not speed <= expected.tcp_speed_m_s * (1 + ROUNDING):
            yield "P6.tcp_speed", f"The TCP moves at {speed:.4g} m/s."
        rotations = turned_by(np.stack([before[ROTATION], action[ROTATION]]))
        turn = float(angle_rad(*rotations)) / period_s
        if not turn <= expected.tcp_turn_rad_s * (1 + ROUNDING):
            yield "P6.tcp_turn", f"The TCP turns at {turn:.4g} rad/s."

    def _rates(self, path: Array, period_s: float, *, loaded: bool) -> Iterator[Finding]:
        """Rates and torques of the path (n, J) that ends at the row, as far as it is known.

        Torques are those at the command before it; `loaded` says whether the hand held on there.
        """
        expected = self.expected
        for order, (name, limit) in enumerate(zip(RATES, expected.rates, strict=True), start=1):
            if len(path) > order:
                rate = np.abs(np.diff(path[-order - 1 :], n=order, axis=0)[0]) / period_s**order
                if not np.all(rate <= limit * (1 + ROUNDING)):
                    yield f"P6.joint_{name}", f"The joints do {rate.tolist()} rad/s^{order}."
        if len(path) > 2:
            speed = (path[-1] - path[-3]) / (2 * period_s)
            acceleration = np.diff(path[-3:], n=2, axis=0)[0] / period_s**2
            arms = [("P6.torque", self._driven), ("P6.payload", self._loaded)]
            for rule, arm in arms[: 1 + loaded]:
                torque = np.abs(arm.torque_nm(path[-2], speed, acceleration))
                if not np.all(torque <= expected.torque_nm + TORQUE_TOLERANCE_NM):
                    yield rule, f"The joints bear {torque.tolist()} N m."

    def _from_measured(self, chunk: Message, ends: Array, period_s: float) -> Iterator[Finding]:
        """What the arm needs from where it was measured; `ends` are last command and row (2, J)."""
        motion, (speed_limit, acceleration_limit) = chunk["motion"], self.expected.arm_rates
        ends_ns = chunk["start_ns"] + (chunk["checked_rows"][0] + 1) * chunk["period_ns"]
        time_s = (ends_ns - motion["measured_ns"]) / 1e9
        if not time_s > 0:
            yield "P6.measured_speed", "The arm was measured after the first row had ended."
            return
        speed = np.abs(ends[1] - floats(motion["q_meas_rad"])) / time_s
        if not np.all(speed <= speed_limit * (1 + ROUNDING)):
            yield "P6.measured_speed", f"The arm must come at {speed.tolist()} rad/s."
        if motion["dq_meas_rad_s"] is not None:
            step = (ends[1] - ends[0]) / period_s - floats(motion["dq_meas_rad_s"])
            if not np.all(np.abs(step) / time_s <= acceleration_limit * (1 + ROUNDING)):
                yield "P6.measured_acceleration", f"The arm must change by {step.tolist()} rad/s."

    def _on_the_way_here(
        self, chunk: Message, before_rad: Array, opening_m: float, phase: str
    ) -> Iterator[str]:
        """What is hit where the arm was measured, or by the commands since then; the first hit."""
        motion = chunk["motion"]
        begins_ns = chunk["start_ns"] + chunk["checked_rows"][0] * chunk["period_ns"]
        since = max(int((begins_ns - motion["measured_ns"]) // chunk["period_ns"]), 0)
        commands = [*before_rad[max(len(before_rad) - since, 0) :], floats(motion["q_cmd_rad"])]
        way, scene = [floats(motion["q_meas_rad"]), *commands], motion["scene"]
        held = opening_m <= self.expected.held_opening_m
        self._pose(way[0], opening_m, held, scene)
        ways = (np.stack(ends) for ends in pairwise(way))
        swept = (self._swept(ends, np.full(2, opening_m), held, phase, scene) for ends in ways)
        for rule, sentence in chain(self._touching(held, phase), chain.from_iterable(swept)):
            if rule != "P6.force":
                yield sentence
                return

    def _touching(self, held: bool, phase: str) -> Iterator[Finding]:
        """What touches what may not, and how hard the held object is pressed where it may."""
        model, contact = self._model, self._data.contact
        contact_phase, pressed_m = phase in self.expected.contact.phases, 0.0
        for index in range(self._data.ncon):
            if not contact.dist[index] < -CONTACT_TOLERANCE_M:
                continue
            pair = sorted(contact.geom[index].tolist(), key=lambda geom: model.geom_group[geom])
            groups = [int(model.geom_group[geom]) for geom in pair]
            if HELD in groups and not held:
                continue
            if SCENE not in groups and self._own.may_meet(*pair):
                continue
            depth_m = -float(contact.dist[index])
            leaning = contact_phase and groups == [HELD, SCENE]
            if leaning and int(model.geom_bodyid[pair[1]]) == self._target:
                pressed_m = max(pressed_m, depth_m)
                continue
            first, second = (model.geom(geom).name for geom in pair)
            rule = "P6.surface" if leaning else "P6.collision"
            yield rule, f"{first} is {depth_m:.3g} m deep in {second}."
        force_n = self.expected.contact.stiffness_n_m * (pressed_m - CONTACT_TOLERANCE_M)
        if contact_phase and not force_n <= self.expected.contact.force_n.get(phase, 0.0):
            yield "P6.force", f"What is held is pressed in with {force_n:.3g} N."

    def _turning_freely(self) -> Iterator[Finding]:
        """Whether the arm can move its TCP any way, by MuJoCo's Jacobian at the pose set last."""
        model, data = self._model, self._data
        jacobian = np.zeros((6, model.nv))
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], self._tcp)
        sizes = np.linalg.svd(jacobian[:, : self._joints], compute_uv=False)
        if not sizes[0] <= self.expected.condition * (1 + ROUNDING) * sizes[-1]:
            yield "P6.singular", f"The Jacobian's singular values are {sizes.tolist()}."

    def _depth_m(self) -> float:
        """How deep what the hand holds reaches below the target's site; -inf without either."""
        if self._target < 0 or self._weld is None or not len(self._held):
            return -math.inf
        self._grasp()
        model, data = self._model, self._data
        boxes = model.geom_aabb[self._held]
        turns = data.geom_xmat[self._held].reshape(-1, 3, 3)[:, 2]
        middle = data.geom_xpos[self._held, 2] + np.sum(turns * boxes[:, :3], axis=1)
        lowest = float(np.min(middle - np.sum(np.abs(turns) * boxes[:, 3:], axis=1)))
        return float(data.site_xpos[self._target_site, 2]) - lowest

    def _swept(
        self, ends: Array, openings: Array, held: bool, phase: str, scene: dict[str, str]
    ) -> Iterator[Finding]:
        """What the way to a row hits, looked at between its `ends` (2, J); the first hit only."""
        pieces = math.ceil(float(np.max(np.abs(ends[1] - ends[0]))) / SWEPT_RAD)
        if pieces > MOST_PIECES:
            yield "P6.sweep", f"A joint turns {pieces * SWEPT_RAD:.3g} rad in one row."
            return
        for share in np.arange(1, pieces) / max(pieces, 1):
            q_rad, opening_m = ends[0] + share * (ends[1] - ends[0]), openings @ (1 - share, share)
            self._pose(q_rad, float(opening_m), held, scene)
            for rule, sentence in self._touching(held, phase):
                if rule != "P6.force":
                    yield "P6.sweep", f"{share:.0%} of the way there, {sentence}"
                    return
