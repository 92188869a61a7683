"""Random chunks through projection and six layers; what is admitted is looked at every millisecond.

    python -m benchmarks.soak chunks --wanted 10000      (`make soak`)

Each draw is a family of chunks, from one that is easy to one that is refused; the admitted one that
is nearest to being refused is looked at. The eye is MuJoCo's kinematics and contacts, and finite
differences, along lines of joints from command to command, and from where the arm was measured.
What the checker of journals says of the same chunks is asked as well: it must object to none.
"""

import math
from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise

import mujoco
import numpy as np

from genpolicy.contract.action import GRIPPER, POSITION, join_action
from genpolicy.contract.chunk import ChunkMetadata, Proposal
from genpolicy.execution.chunk_queue import _motion
from genpolicy.execution.journal import encode_actions
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker
from genpolicy.feasibility.cell import cell_of
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.figures import expected_motion
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.controller import CONTROLLER_MODE
from genpolicy.robot.impedance import STIFFNESS_N_M
from genpolicy.robot.scene_state import SceneState
from genpolicy.tasks.api import load_task
from genpolicy.verification.body import OwnBody
from genpolicy.verification.motion import MotionProof

PERIOD_S, ROWS, BEFORE = 0.05, 16, 3
MILLISECONDS = 50  # of a period
TOGETHER, ROUNDS = 64, 8
DOWN = np.diag([1.0, -1.0, -1.0])
HOME = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785])
KINDS = ("free", "edge", "beside", "beside", "onto", "down")
TOUCH_M = 1e-6  # two libraries may disagree about a touch by this
ARC_M = 5e-4  # a line of joints between two poses on a face of the box bulges out of it
ROUNDING = 1e-5
GRASP_M, HALF_WIDTH_M = 0.1184, 0.01  # the peg in the hand, as the scene file says
HELD, SCENE = 2, 3


def rotations(turns):
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3), rad."""
    angle = np.linalg.norm(turns, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(turns / np.maximum(angle[..., 0], 1e-12), -1, 0)
    o = np.zeros_like(x)
    k = np.stack([o, -z, y, z, o, -x, -y, x, o], axis=-1).reshape(*x.shape, 3, 3)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


@dataclass(frozen=True)
class Family:
    """Paths of the TCP: `BEFORE` commands that were given, then the rows of a chunk.

    Attributes:
        kind: What is drawn.
        phase: Task phase.
        easy_m: The easiest path. Shape (BEFORE + ROWS, 3).
        towards_m: From there to one that is hardly possible.
        rotation: Of each.
        opening_m: Of each.
        scene: Where post and target stand.
        late: Rows that are late.
        aside_rad: How far the arm was seen beside its last command. Shape (7,).
        seen_s: How long ago.
    """

    kind: str
    phase: str
    easy_m: np.ndarray
    towards_m: np.ndarray
    rotation: np.ndarray
    opening_m: np.ndarray
    scene: SceneState
    late: int
    aside_rad: np.ndarray
    seen_s: float

    def position_m(self, share):
        """So much of the way towards the one that is refused."""
        return self.easy_m + share * self.towards_m


def drawn(rng, cell, kinds=KINDS):
    """One family: far and fast, along the box, beside something, onto the target, into it."""
    box = np.array([cell.workspace.lower_m, cell.workspace.upper_m])
    kind = str(rng.choice(kinds))
    yaw, swing = rng.uniform(-0.3, 0.3), rng.normal(0, rng.choice([0.0, 0.1, 0.3]), 3)
    hole = np.array([rng.uniform(0.60, 0.68), rng.uniform(-0.05, 0.05), 0.0])
    post = np.array([0.50, rng.uniform(-0.05, 0.05), 0.11])
    turned = (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))
    scene = SceneState({"post": (post, (1.0, 0.0, 0.0, 0.0)), "fixture": (hole, turned)})
    free, contact = sorted(set(cell.phases) - cell.contact_phases), sorted(cell.contact_phases)
    phase = str(rng.choice(contact if kind == "down" else free))
    opening = np.full(BEFORE + ROWS, rng.choice([0.0, 0.0, 0.01, 0.04]) * (kind != "down"))
    tilt = rng.normal(0, rng.choice([0.0, 0.15, 0.4]), 3)
    start, way = rng.uniform(*box), rng.normal(0, 1, 3)
    way *= rng.uniform(0.02, 0.4) / np.linalg.norm(way)
    pace = np.linspace(0, 1, BEFORE + ROWS)
    if rng.random() < 0.7:
        t = np.linspace(*np.sort(rng.uniform(0, 1, 2)), BEFORE + ROWS)
        pace = t**3 * (10 - 15 * t + 6 * t**2)
        pace = (pace - pace[0]) / max(pace[-1] - pace[0], 1e-6)
    pace = pace[:, None]
    if kind == "edge":
        axis, side = rng.integers(3), rng.integers(2)
        start[axis], way[axis] = box[side, axis], 0.0
    easy, towards = start + 0 * pace, pace * way
    if kind == "beside":
        angle = rng.uniform(0, 2 * math.pi)
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        across = np.array([-out[1], out[0], 0.0]) * rng.choice([-1, 1]) * rng.uniform(0.02, 0.15)
        across[2] = rng.normal(0, 0.03)
        middle = (post if rng.random() < 0.6 else hole) + 0.2 * out
        middle[2] = rng.uniform(*box[:, 2])
        bulge = rng.normal(0, rng.choice([0.0, 0.02]), 3)
        easy = middle + (pace - 0.5) * across + np.sin(np.pi * pace) * bulge
        towards = np.broadcast_to(-0.2 * out, easy.shape)
    elif kind in ("onto", "down"):
        tilt, swing = np.array([0.0, 0.0, yaw]) + rng.normal(0, 0.02, 3) * (rng.random() < 0.5), 0.0
        off = rng.normal(0, rng.choice([0.0005, 0.002, 0.006, 0.03]), 2)
        easy = hole + [*off, 0.115 + rng.uniform(-0.04, 0.04)] + 0 * pace
        towards = pace * [0.0, 0.0, -0.08]
    easy[BEFORE:] += rng.normal(0, rng.choice([0.0, 0.0003, 0.001]), (ROWS, 3))
    if rng.random() < 0.2:  # the hand opens on the way
        opening[rng.integers(BEFORE, BEFORE + ROWS) :] = 0.04
    old = rng.random() < 0.3
    aside = rng.uniform(-0.3, 0.3, cell.joint_count) * old
    late = int(rng.choice([0, 0, 0, 1, 3, 6]))
    turns = rotations(tilt + pace * swing) @ DOWN
    return Family(kind, phase, easy, towards, turns, opening, scene, late, aside, 0.15 * old)


def asked(checker, families, shares):
    """A proposal and a context, by number, of each path that the arm can begin."""
    arm, found = checker.kinematics, {}
    ways = [family.position_m(share) for family, share in zip(families, shares, strict=True)]
    begun = [slice(family.late, family.late + BEFORE) for family in families]
    place = np.stack([way[rows] for way, rows in zip(ways, begun, strict=True)])
    turn = np.stack([f.rotation[rows] for f, rows in zip(families, begun, strict=True)])
    seeds = np.tile(HOME, (len(families), 1))
    first = arm.solve_with_restarts(place[:, 0], turn[:, 0], q_seed_rad=seeds)
    q, good = [first.q_rad], first.converged
    for step in range(1, BEFORE):
        solved = arm.solve(place[:, step], turn[:, step], q_seed_rad=q[-1])
        q.append(solved.q_rad)
        good = good & solved.converged
    for i in np.flatnonzero(good):
        family, path = families[i], np.stack([part[i] for part in q])
        actions = join_action(ways[i], family.rotation, family.opening_m)
        step, now_s = path[-1] - path[-2], 10.0 + family.late * PERIOD_S
        context = Context(
            q_meas=path[-1] - 0.5 * step + family.aside_rad, q_cmd=path[-1],
            last_action=actions[begun[i]][-1], now_s=now_s, phase=family.phase,
            calibration_epoch="e0", session_epoch=1, latest_observation_event_time_s=9.95,
            maximum_age_s=1.0, active_checkpoint_hash="w", active_sampler_hash="s",
            scene=family.scene, q_cmd_history=path[:-1], first_index=family.late,
            dq_meas=None if family.seen_s else step / PERIOD_S,
            state_time_s=now_s - family.seen_s, controller_mode=CONTROLLER_MODE,
        )  # fmt: skip
        about = ChunkMetadata(
            chunk_id=f"c{i}", condition_observation_event_time_s=9.9, policy_checkpoint_hash="w",
            sampler_config_hash="s", action_start_time_s=10.0, action_period_s=PERIOD_S,
            valid_until_s=11.0, task_phase=family.phase, calibration_epoch="e0",
            predecessor_chunk_id="", session_epoch=1, method="dense", candidate_index=0,
        )  # fmt: skip
        found[int(i)] = Proposal(about, actions[BEFORE:], "first"), context
    return found


def hardest(checker, families):
    """Of each family the admitted chunk that is nearest to being refused, and what refused last."""
    low, high = np.zeros(len(families)), np.full(len(families), 2.0)
    best, reason = {}, {}
    for step in range(ROUNDS):
        shares = (low + high) / 2 if step else low
        found = asked(checker, families, shares)
        results = checker.admit_many(*map(list, zip(*found.values(), strict=True)))
        answers = dict(zip(found, results, strict=True))
        for i, share in enumerate(shares):
            answer = answers.get(i)
            if isinstance(answer, Admitted):
                best[i], low[i] = answer, share
                continue
            high[i] = share if step else high[i]
            reason[i] = "no start" if answer is None else answer.reason
    return best, reason


def _angles(turns):
    """Angles between rotations in a row, rad. Shape (n - 1,)."""
    cosine = (np.einsum("nij,nij->n", turns[1:], turns[:-1]) - 1) / 2
    return np.arccos(np.clip(cosine, -1, 1))


class Eye:
    """Looks at a chunk every millisecond, with MuJoCo alone.

    Attributes:
        worst: The largest of each figure that was seen.
    """

    def __init__(self, cell):
        self.settings, self.limits = cell.settings, cell.usable_limits
        self.contact_phases, self.force_n = cell.contact_phases, cell.force_envelope_n
        self.model = model = mujoco.MjModel.from_xml_path(str(cell.kinematics.scene_path))
        self.data = mujoco.MjData(model)
        self.joints = cell.joint_count
        self.tcp, self.hand = model.site("tcp").id, model.body("hand").id
        self.target = model.body("fixture").id
        self.own = OwnBody(model, self.joints, 0)
        self.fingers = model.jnt_qposadr[model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE]
        self.peg = int(model.jnt_qposadr[model.body("peg").jntadr[0]])
        model.geom_margin[:] = 0.002  # what is this close is listed, touching or not
        self.box = np.array([cell.workspace.lower_m, cell.workspace.upper_m])
        self.worst: dict[str, float] = {}
        self.groups, self.bodies = model.geom_group.tolist(), model.geom_bodyid.tolist()
        self.mocap: dict[str, int] = {}
        self.meets: dict[tuple[int, int], bool] = {}

    def place(self, q, opening, held, scene):
        """Put arm, fingers, scene and what is held where they are."""
        model, data = self.model, self.data
        data.qpos[: self.joints] = q
        data.qpos[self.fingers] = max(opening, HALF_WIDTH_M) if held else opening
        for name, (position, quaternion) in scene.bodies.items():
            if name not in self.mocap:
                self.mocap[name] = int(model.body_mocapid[model.body(name).id])
            mocap = self.mocap[name]
            data.mocap_pos[mocap], data.mocap_quat[mocap] = position, quaternion
        mujoco.mj_kinematics(model, data)
        data.qpos[self.peg : self.peg + 3] = (0.0, 0.0, 50.0)
        if held:
            turned, deep = np.zeros(4), data.xmat[self.hand].reshape(3, 3)[:, 2] * GRASP_M
            mujoco.mju_mulQuat(turned, data.xquat[self.hand], np.array([0.0, 1.0, 0.0, 0.0]))
            data.qpos[self.peg : self.peg + 3] = data.xpos[self.hand] + deep
            data.qpos[self.peg + 3 : self.peg + 7] = turned
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)

    def touching(self, phase, clearance_m, *, commanded=True):
        """The first pair that is nearer than it may be, or what is pressed too hard."""
        model, contact, pressed_m = self.model, self.data.contact, 0.0
        for (a, b), dist_m in zip(contact.geom.tolist(), contact.dist.tolist(), strict=True):
            groups = {self.groups[a], self.groups[b]}
            if SCENE not in groups and self._may_meet(a, b):
                continue
            bodies = (self.bodies[a], self.bodies[b])
            into_target = groups == {HELD, SCENE} and self.target in bodies
            if phase in self.contact_phases and into_target:
                pressed_m = max(pressed_m, -dist_m)
                continue
            lacking_m = clearance_m - dist_m
            self._saw("lacking of the clearance, m", lacking_m)
            if lacking_m > TOUCH_M:
                return f"{model.geom(a).name} and {model.geom(b).name}, {lacking_m:.2g}"
        pressed_n = STIFFNESS_N_M * (pressed_m - TOUCH_M)
        hard = commanded and pressed_n > self.force_n.get(phase, 0.0)
        return f"{pressed_n:.3g} N" if hard else ""

    def _may_meet(self, a, b):
        if (a, b) not in self.meets:
            self.meets[a, b] = self.own.may_meet(a, b)
        return self.meets[a, b]

    def objections(self, admitted):
        """What is wrong with an admitted chunk; nothing if it is as it should be."""
        context, settings = admitted.context, self.settings
        first, last = admitted.verdict.rows
        path = np.concatenate([context.q_cmd[None], admitted.verdict.q_rad])
        actions = np.concatenate([context.last_action[None], admitted.actions[first:last]])
        inside = context.phase in self.contact_phases
        clearance_m = settings.contact_clearance_m if inside else settings.clearance_m
        openings = actions[:, GRIPPER]
        held = np.logical_and.accumulate(openings <= settings.held_opening_m)
        found, places, turns = [], [], []
        for row in range(len(path) - 1):
            for ms in range(0 if row == 0 else 1, MILLISECONDS + 1):
                share = ms / MILLISECONDS
                opening = openings[row] + share * (openings[row + 1] - openings[row])
                has = held[row] if ms < MILLISECONDS else held[row + 1]
                self.place(path[row] + share * (path[row + 1] - path[row]), opening, has,
                           context.scene)  # fmt: skip
                places.append(self.data.site_xpos[self.tcp].copy())
                turns.append(self.data.site_xmat[self.tcp].reshape(3, 3).copy())
                # What presses is a command; on the way between two of them nothing commands.
                told = ms == MILLISECONDS
                wrong = self.touching(context.phase, clearance_m, commanded=told) if ms else ""
                found += [f"row {row}, {ms} ms: {wrong}"] * bool(wrong)
        since = round((context.now_s - context.measured_at_s) / PERIOD_S)
        known = context.q_cmd_history[max(len(context.q_cmd_history) - since, 0) :]
        way = [context.q_meas, *known, context.q_cmd]
        for before, after in pairwise(way):
            for share in np.linspace(0, 1, MILLISECONDS):
                q = before + share * (after - before)
                self.place(q, openings[0], held[0], context.scene)
                wrong = self.touching(context.phase, 0.0, commanded=False)
                found += [f"{share:.0%} of the way from where it was: {wrong}"] * bool(wrong)
        return found + self._figures(path, np.array(places), np.array(turns), actions)

    def _figures(self, path, places, turns, actions):
        settings, dt = self.settings, PERIOD_S / MILLISECONDS
        moved = np.linalg.norm(np.diff(places, axis=0), axis=1) / dt
        outside = np.maximum(self.box[0] - places, places - self.box[1]).max(axis=1)
        outside[: MILLISECONDS + 1] -= max(outside[0], 0.0)  # it may come back from where it stood
        joints = np.abs(np.diff(path, axis=0)) / PERIOD_S / self.limits.velocity_rad_s
        missed = np.linalg.norm(places[::MILLISECONDS] - actions[:, POSITION], axis=1)[1:]
        rows = slice(None, None, MILLISECONDS)
        steps = np.linalg.norm(np.diff(places[rows], axis=0), axis=1) / PERIOD_S
        angle = _angles(turns[rows]) / PERIOD_S
        speed, turn = settings.tcp_speed_limit_m_s, settings.tcp_turn_limit_rad_s
        figures = (
            ("m outside the workspace", outside, ARC_M),
            ("of its speed", steps / speed, 1 + ROUNDING),
            ("of its turn", angle / turn, 1 + ROUNDING),
            # Limits are those of a step; within one a line of joints is not even.
            ("of its speed at a millisecond", moved / speed, math.inf),
            ("of its turn at a millisecond", _angles(turns) / dt / turn, math.inf),
            ("of a joint's speed", joints, 1 + ROUNDING),
            ("m off its pose", missed, 1e-5),
        )
        for name, values, _ in figures:
            self._saw(name, float(np.max(values)))
        return [f"{np.max(v):.4g} {name}" for name, v, limit in figures if not np.max(v) <= limit]

    def _saw(self, name, value):
        self.worst[name] = max(value, self.worst.get(name, value))


def proved(proof, admitted, session):
    """What the checker of journals says of all rows of it."""
    context, metadata = admitted.context, admitted.metadata
    first, last = admitted.verdict.rows
    message = {
        "chunk_id": metadata.chunk_id, "actions": encode_actions(admitted.actions),
        "rows": len(admitted.actions), "checked_rows": [first, last],
        "start_ns": round(metadata.action_start_time_s * 1e9), "period_ns": round(PERIOD_S * 1e9),
        "motion": _motion(admitted),
    }  # fmt: skip
    said = (
        proof.objections(session, message, row, phase=context.phase, period_s=PERIOD_S)
        for row in range(first, last)
    )
    return [f"{rule}: {sentence}" for findings in said for rule, sentence in findings]


@dataclass
class Looked:
    """What was looked at, and what was wrong with it."""

    admitted: Counter = field(default_factory=Counter)
    refused: Counter = field(default_factory=Counter)
    wrongs: list[str] = field(default_factory=list)
    worst: dict[str, float] = field(default_factory=dict)


def look(seed, admitted, checks=CHECKS, *, kinds=KINDS, until=None):
    """So many admitted chunks of a table of checks, drawn by a seed; fewer once this is said."""
    cell = cell_of(
        load_task("tabletop_insertion"),
        FeasibilitySettings(position_change_limit_m=0.05),
        action_period_s=PERIOD_S,
    )
    checker, eye = FeasibilityChecker(cell, checks=checks), Eye(cell)
    proof, rng, found = MotionProof(expected_motion(cell)), np.random.default_rng(seed), Looked()
    found.worst = eye.worst
    while found.admitted.total() < admitted:
        families = [drawn(rng, cell, kinds) for _ in range(TOGETHER)]
        best, reasons = hardest(checker, families)
        found.refused.update(reasons.values())
        for i, chunk in best.items():
            number = found.admitted.total()
            if number == admitted or any(until in wrong for wrong in found.wrongs if until):
                return found
            said = eye.objections(chunk) or proved(proof, chunk, f"{seed}/{number}")
            found.admitted[families[i].kind] += 1
            found.wrongs += [f"chunk {number} ({families[i].kind}): {one}" for one in said[:1]]
    return found
