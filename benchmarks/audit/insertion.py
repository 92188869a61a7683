"""The insertion task with its own scripted operators, at 20 Hz, on a plant without physics.

The operators, their routes, phases, starts and the observation are those of the embedded task; only
the arm is replaced by a first-order plant that nothing touches, which is some hundred times faster.
One column is added to the observation: a lamp, as in the planar task.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.audit.plan import OPERATORS, Array, Plan, Roster
from benchmarks.audit.tool import intent, profiles, turned
from benchmarks.audit.truth import INSTANT_S, SUB_STEPS, Truth
from genpolicy.seeds import stream
from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.experts import STYLES, Operator, Order
from genpolicy.tasks.tabletop_insertion.observation import OBSERVATION, PHASES
from genpolicy.tasks.tabletop_insertion.phases import Measured, PhaseLogic
from genpolicy.tasks.tabletop_insertion.plans import ACTION_PERIOD_S
from genpolicy.tasks.tabletop_insertion.start import InsertionStart, sample_start

PERIOD_S = ACTION_PERIOD_S
MAXIMUM_TICKS = 400
CONTEXT_M = 0.10
# Distance from the post's axis relative to the operator's own; near and wide where there are more.
LANES = {2: (("left", 1.0), ("right", 1.0))}
MORE_LANES = (("left", 0.8), ("right", 0.8), ("left", 1.5), ("right", 1.5))
HALF_WIDTH_M = 0.13
GOAL_HALF_WIDTH_M = 0.020
START_HALF_WIDTH_M = 0.010
POST_AND_HAND_M = 0.055
FORCE_NOISE_N = 0.15
INSERTION_FORCE_N = 2.0
# An operator judges where the arm is on average over this time, not where its tremor takes it.
GLANCE_S = 0.3
# About as long as an approach takes.
APPROACH_TICKS = 50
MEASURED_ROTATION_NOISE = 0.001
SCENE_LENGTHS = [0, 1, 4]
SLICES = OBSERVATION.slices
SCALE = {"m": 0.01, "N": 5.0, "1": 0.1}


@dataclass(frozen=True)
class Cell:
    """The plant of one data set, the same for all of its episodes."""

    dead_steps: int
    constant_s: float


def make_cell(plan: Plan) -> Cell:
    """The plant of one data set."""
    if plan.exact:
        # The plant moves to a target in the course of a period: at its end it is there.
        return Cell(dead_steps=0, constant_s=INSTANT_S)
    rng = stream(plan.seed, "cell")
    return Cell(int(rng.integers(1, 6)), rng.uniform(0.02, 0.05))


class Plant:
    """A point that follows its target with a dead time and to the first order."""

    def __init__(self, at: Array, cell: Cell) -> None:
        self.at = self._from = at
        self.fine: list[Array] = []
        self._share = 1.0 - np.exp(-PERIOD_S / SUB_STEPS / cell.constant_s)
        self._queue = [at] * cell.dead_steps

    def follow(self, target: Array) -> None:
        """One action period, towards the target at an even pace."""
        for step in range(1, SUB_STEPS + 1):
            self.fine.append(self.at)
            self._queue.append(self._from + step / SUB_STEPS * (target - self._from))
            self.at = self.at + self._share * (self._queue.pop(0) - self.at)
        self._from = target


class Kinematic:
    """What an operator sees of its cell."""

    def __init__(self, start: InsertionStart, cell: Cell) -> None:
        self.start = start
        self._plant = Plant(np.array([start.tcp_x_m, start.tcp_y_m, start.tcp_z_m]), cell)
        self.fine = self._plant.fine
        self._seen: list[Array] = [self._plant.at]
        self.contact_force_n = 0.0
        self._phases = PhaseLogic()
        self._holding = True
        self._recover = False

    @property
    def tcp_pose(self) -> tuple[Array, Array]:
        return np.mean(self._seen[-round(GLANCE_S / PERIOD_S) :], axis=0), np.eye(3)

    @property
    def phase(self) -> str:
        return self._phases.phase

    @property
    def tip_depth_m(self) -> float:
        return scene.FIXTURE_TOP_M - (float(self.tcp_pose[0][2]) - scene.TIP_OFFSET_M)

    def request_recovery(self, active: bool) -> None:
        self._recover = active

    def advance(self, action: Array) -> None:
        """One action period."""
        self._plant.follow(action[:3])
        self._seen.append(self._plant.at)
        opening = float(action[9])
        self._holding = self._holding and opening < scene.RELEASE_OPENING_M
        self._phases.update(
            Measured(
                tcp_m=self._plant.at,
                hole_xy_m=np.array([self.start.hole_x_m, self.start.hole_y_m]),
                gripper_opening_m=opening,
                holding=self._holding,
                deviation_m=0.0,
                recovery_requested=self._recover,
            ),
            period_s=PERIOD_S,
        )


class Guided(Operator):
    """An operator that does something else before it goes to the hole."""

    prelude: tuple[tuple[str, object], ...] = ()

    def _run(self) -> Iterator[bool]:
        for what, argument in self.prelude:
            if what == "wait":
                yield from self._wait(float(argument))
            elif what == "begin":
                self.begun = True
            else:
                yield from self._move(np.asarray(argument), speed_m_s=self._style.speed_m_s)
        self.begun = True
        yield from super()._run()


def demonstrate(plan: Plan, roster: Roster, number: int, cell: Cell) -> Truth:
    """One episode of the roster."""
    rng = stream(plan.seed, "episode", number)
    mode, cue = int(roster.mode[number]), int(roster.cue[number])
    start = _start(plan, roster, number, rng)
    lanes = LANES.get(max(2, len(plan.shares)), MORE_LANES)
    side, wide = lanes[mode if plan.differ == "position" else 0]
    way = intent(plan, mode, stream(plan.seed, "intent", number))
    style = STYLES[str(roster.operator[number])]
    via = style.via_m * wide * plan.width + plan.spread(rng)
    style = replace(style, via_m=via, speed_m_s=style.speed_m_s * rng.uniform(0.92, 1.08))
    style = replace(style, speed_m_s=style.speed_m_s * way.pace)
    kind = "wander" if roster.recovery[number] else "nominal"
    kind = "missed" if roster.failure[number] else kind
    world = Kinematic(_moved(plan, start, cue), cell)
    operator = Guided(world, order=Order(kind=kind, side=side, style=style), rng=rng)
    operator.prelude, lit = _prelude(plan, world.start, rng)
    operator.begun = False
    actions, phases = [], []
    while len(actions) < MAXIMUM_TICKS and (action := operator.act()) is not None:
        action[:3] += plan.tremor_m * rng.normal(size=3)
        phases.append("fetch" if plan.station_dwell_s and not operator.begun else world.phase)
        actions.append(action)
        world.advance(action)
    commands = np.array(actions)
    if plan.tool:
        _use_tool(commands, phases, way)
    truth = _truth(plan, start, commands, phases, world, lit, cue, rng, kind != "missed")
    moved = plan.moved(len(commands), (0, APPROACH_TICKS), number)
    return truth if moved is None else _with_moved_goal(truth, moved, cell)


def _with_moved_goal(truth: Truth, moved: Array, cell: Cell) -> Truth:
    """The operator stays where it is to the goal; the plant answers linearly."""
    shift = np.pad(moved, ((0, 0), (0, 1)))
    plant = Plant(np.zeros(3), cell)
    for target in shift:
        plant.follow(target)
    fine = truth.fine + np.array(plant.fine)
    return replace(truth, command=truth.command + shift, fine=fine, moved=moved)


def _use_tool(actions: Array, phases: list[str], way) -> None:
    """Turn and grip on the approach, in place; what was planned after it is kept."""
    last = max((k for k, phase in enumerate(phases) if phase == "approach"), default=0)
    angle, opening = profiles(way, actions[:, :3], 0, last)
    actions[:, 3:9] = turned(actions[:, 3:9], angle)
    actions[: last + 1, 9] = opening[: last + 1]


def _start(plan: Plan, roster: Roster, number: int, rng: np.random.Generator) -> InsertionStart:
    start = sample_start(rng)
    lateral = float(roster.goal_lateral_m[number])
    lateral += CONTEXT_M * (int(roster.context[number]) - 0.5 * (plan.contexts - 1))
    return replace(
        start,
        hole_y_m=lateral,
        tcp_x_m=0.38 + plan.start_wide * (start.tcp_x_m - 0.38),
        tcp_y_m=plan.start_wide * start.tcp_y_m,
    )


def _moved(plan: Plan, start: InsertionStart, cue: int) -> InsertionStart:
    """The start of an operator that comes from the side that it intends."""
    if plan.decided_by != "path_early":
        return start
    return replace(start, tcp_y_m=start.tcp_y_m + (0.05 if cue == 0 else -0.05))


def _prelude(plan: Plan, start: InsertionStart, rng: np.random.Generator):
    """What happens before the operator goes, and how many ticks the lamp is on."""
    here = np.array([start.tcp_x_m, start.tcp_y_m, start.tcp_z_m])
    pause_s = PERIOD_S * int(rng.integers(1, 6))
    if plan.decided_by == "path_early":
        gate = np.array([start.tcp_x_m + 0.05, 0.006 * rng.uniform(-1.0, 1.0), 0.155])
        return (("wait", pause_s), ("move", gate), ("wait", 0.15)), 0
    if plan.decided_by == "lamp_early":
        on = 6 + int(rng.integers(0, 4))
        return (("wait", PERIOD_S * (on + int(rng.integers(5, 11)))),), on
    if plan.station_dwell_s:
        station = np.array([0.44, -0.17, 0.16]) + 0.006 * rng.uniform(-1.0, 1.0, 3)
        rest_s = plan.station_dwell_s + PERIOD_S * int(rng.integers(0, 3))
        return (
            ("wait", pause_s + plan.station_dwell_s), ("move", station), ("wait", 0.2),
            ("move", here), ("begin", None), ("wait", rest_s),
        ), 0  # fmt: skip
    return (("wait", pause_s),), 0


def _truth(plan, start, actions, phases, world, lit, cue, rng, success) -> Truth:
    n = len(actions)
    before = np.vstack([actions[:1], actions[:-1]])
    wrench = FORCE_NOISE_N * rng.normal(size=(n, 3))
    wrench[np.array(phases) == "insert", 2] += INSERTION_FORCE_N
    lamp = np.zeros(n)
    lamp[:lit] = 2.0 * cue - 1.0
    if plan.decided_by == "lamp":
        lamp[:] = 2.0 * cue - 1.0
    return Truth(
        command=actions[:, :3],
        fine_s=PERIOD_S / SUB_STEPS * np.arange(len(world.fine)),
        fine=np.array(world.fine),
        scene=np.array([
            start.hole_x_m, start.hole_y_m, np.cos(start.hole_yaw_rad),
            np.sin(start.hole_yaw_rad), start.post_y_m,
        ]),
        lamp=lamp,
        phase=phases,
        success=success,
        other={
            "tool": before[:, 3:] + MEASURED_ROTATION_NOISE * rng.normal(size=(n, 7)),
            "wrench": wrench,
            "phase_flag": np.array([[name == phase for name in PHASES] for phase in phases]) * 1.0,
            "tool_command": actions[:, 3:],
        },
    )  # fmt: skip


def admissible(plan: Plan):
    """Check of a path against the post with a margin for the hand."""
    radius = POST_AND_HAND_M * min(1.0, plan.width)

    def check(actions: Array, observation: Array) -> tuple[bool, str]:
        post = np.array([scene.POST_X_M, observation[SLICES["post_position_m"]][0]])
        hit = float(np.min(np.linalg.norm(actions[:, :2] - post, axis=1))) < radius
        return not hit, "collision" if hit else ""

    return check


def layout(columns: dict[str, Array]) -> dict[str, object]:
    """Observation and action of the rows, and where what lies in them."""
    observation = np.hstack([
        columns["position"], columns["tool"], columns["wrench"], columns["scene"],
        columns["phase_flag"], columns["lamp"],
    ])  # fmt: skip
    scale = []
    for channel in OBSERVATION.channels:
        for part in channel.components:
            unit = "m" if part.endswith("_m") else channel.unit
            scale.append(np.inf if channel.name == "phase" else SCALE[unit])
    hole = SLICES["hole_pose"]
    return {
        "observation": observation,
        "action": np.hstack([columns["command"], columns["tool_command"]]),
        "observation_scale": np.array([*scale, 0.1]),
        "observation_names": (*OBSERVATION.component_names, "lamp"),
        "observation_position": slice(0, 3),
        "action_position": slice(0, 3),
        "action_rotation": slice(3, 9),
        "action_gripper": slice(9, 10),
        "reference": hole,
        "context": {"hole_pose": hole, "lamp": slice(24, 25)},
        "streams": {
            "robot": slice(0, hole.start - 3),
            "force": slice(hole.start - 3, hole.start),
            "camera": np.array([*range(hole.start, hole.start + 5), 24]),
        },
    }


assert set(OPERATORS) <= set(STYLES)
