"""The planar task: past a post to a goal, at 10 Hz, in milliseconds.

Observed: x, y; goal x, y; a lamp. Commanded: x, y. The arm rests, passes the post on one side
(near or wide), and rests at the goal. An operator has an own speed and width. Where modes are
planted in the tool, it also turns and grips, and both are observed a tick later.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.audit.plan import OPERATORS, Array, Plan, Roster
from benchmarks.audit.tool import intent, profiles, turned
from benchmarks.audit.truth import INSTANT_S, SUB_STEPS, Truth, follow
from genpolicy.seeds import stream
from genpolicy.tasks.tabletop_insertion.plans import travel

PERIOD_S = 0.1
POST_M = np.array([0.15, 0.0])
GOAL_M = np.array([0.30, 0.0])
STATION_M = np.array([0.05, -0.16])
CONTEXT_M = 0.12
HALF_WIDTH_M = 0.09
GOAL_HALF_WIDTH_M = 0.010
START_HALF_WIDTH_M = 0.008
POST_RADIUS_M = 0.045
SCENE_LENGTHS = [0, 1]
# Where the routes of the modes pass the post, in half widths.
LANES = (1.0, -1.0, 2.1, -2.1)
SETTLE_TICKS = 3
SPEED_M_S = dict(zip(OPERATORS, (0.095, 0.110, 0.125), strict=True))
WIDTH = dict(zip(OPERATORS, (0.96, 1.0, 1.05), strict=True))
ACCELERATION_M_S2 = 0.5
MEASURED_TOOL_NOISE = 0.001
TOOL = (*(f"tool.rotation_{number}" for number in range(6)), "tool.opening_m")
TOOL_SCALE = (*(0.1,) * 6, 0.01)


@dataclass(frozen=True)
class Cell:
    """The plant of one data set, the same for all of its episodes."""

    delay_s: float
    constant_s: float


def make_cell(plan: Plan) -> Cell:
    """The plant of one data set."""
    if plan.exact:
        return Cell(delay_s=PERIOD_S, constant_s=INSTANT_S)
    rng = stream(plan.seed, "cell")
    return Cell(rng.uniform(0.02, 0.15), rng.uniform(0.05, 0.12))


def demonstrate(plan: Plan, roster: Roster, number: int, cell: Cell) -> Truth:
    """One episode of the roster."""
    rng = stream(plan.seed, "episode", number)
    mode, cue = int(roster.mode[number]), int(roster.cue[number])
    start = START_HALF_WIDTH_M * plan.start_wide * rng.uniform(-1.0, 1.0, 2)
    goal = GOAL_M + np.array([0.010 * rng.uniform(-1.0, 1.0), roster.goal_lateral_m[number]])
    goal[1] += CONTEXT_M * (roster.context[number] - 0.5 * (plan.contexts - 1))
    operator = str(roster.operator[number])
    speed = SPEED_M_S[operator] * rng.uniform(0.9, 1.1)
    width = HALF_WIDTH_M * plan.width * WIDTH[operator] + plan.spread(rng)
    way = intent(plan, mode, stream(plan.seed, "intent", number))
    speed *= way.pace
    lane = LANES[mode if plan.differ == "position" else 0] * width
    pieces, lamp = [], []
    if plan.decided_by == "path_early":  # comes from the side that it intends, through one gate
        start[1] += 0.045 * (1.0 if cue == 0 else -1.0)
        gate = np.array([0.06, 0.006 * rng.uniform(-1.0, 1.0)])
        pieces += [rest(start, rng.integers(0, 4)), move([start, gate], speed), rest(gate, 2)]
        here = gate
    else:
        pieces.append(rest(start, 1 if plan.exact else rng.integers(1, 6)))
        here = start
    if plan.station_dwell_s:
        dwell = round(plan.station_dwell_s / PERIOD_S)
        away = STATION_M + 0.006 * rng.uniform(-1.0, 1.0, 2)
        pieces += [rest(start, dwell), move([start, away], speed), rest(away, 3)]
        pieces += [move([away, start], speed), rest(start, dwell + int(rng.integers(0, 3)))]
    if plan.decided_by == "lamp_early":  # seen while the arm rests, and gone before it goes
        pieces.append(rest(start, 4 + int(rng.integers(4, 9))))
        lamp = [float(2 * cue - 1)] * (len(pieces[0]) + 4)
    middle = 0.5 * (here + goal)
    middle[1] = 0.4 * middle[1] + lane
    end = goal + (0.0 if not roster.failure[number] else rng.choice([-1, 1]) * 0.03)
    path = move([here, middle, end], speed)
    if roster.recovery[number]:
        path = bump(path, rng)
    begin = sum(len(piece) for piece in pieces)
    command = np.vstack([*pieces, path, rest(end, rng.integers(7, 12))])
    command = command + plan.tremor_m * rng.normal(size=command.shape)
    moved = plan.moved(len(command), (begin, len(path)), number)
    if moved is not None:
        command = command + moved
    first = begin + len(path) + SETTLE_TICKS  # at rest at the goal, it lets go
    phase = ["approach"] * first + ["release"] * (len(command) - first)
    if plan.station_dwell_s:
        fetch = begin - len(pieces[-1])
        phase[:fetch] = ["fetch"] * fetch
    light = np.zeros(len(command))
    light[: len(lamp)] = lamp
    if plan.decided_by == "lamp":
        light[:] = 2 * cue - 1
    return Truth(
        command=command,
        fine_s=PERIOD_S / SUB_STEPS * np.arange(len(command) * SUB_STEPS),
        fine=follow(
            command, period_s=PERIOD_S, delay_s=cell.delay_s, constant_s=cell.constant_s
        ),
        scene=goal, lamp=light, phase=phase, success=not roster.failure[number],
        moved=moved,
        other=_tool(command, way, begin, begin + len(path), rng) if plan.tool else {},
    )  # fmt: skip


def _tool(command: Array, way, first: int, last: int, rng: np.random.Generator):
    """Rotation and opening of each tick, commanded, and observed one tick later."""
    angle, opening = profiles(way, command, first, last)
    straight = np.tile([1.0, 0.0, 0.0, 0.0, 1.0, 0.0], (len(command), 1))
    tool = np.hstack([turned(straight, angle), opening[:, None]])
    before = np.vstack([tool[:1], tool[:-1]])
    return {
        "tool": before + MEASURED_TOOL_NOISE * rng.normal(size=before.shape),
        "tool_command": tool,
    }


def admissible(plan: Plan):
    """Check of a path against a round post that every lane of a demonstrator clears."""
    radius = POST_RADIUS_M * min(1.0, plan.width)

    def check(actions: Array, observation: Array) -> tuple[bool, str]:
        hit = float(np.min(np.linalg.norm(actions[:, :2] - POST_M, axis=1))) < radius
        return not hit, "collision" if hit else ""

    return check


def rest(at: Array, ticks: int) -> Array:
    """Standing still. Shape (ticks, 2)."""
    return np.tile(at, (int(ticks), 1))


def move(points: list[Array], speed_m_s: float) -> Array:
    """From rest to rest along a smooth curve through the points. Shape (n, 2)."""
    spatial = np.column_stack([np.array(points), np.zeros(len(points))])
    # `travel` samples at 20 Hz: every other position is this task's 10 Hz.
    path = travel(spatial, speed_m_s=speed_m_s, acceleration_m_s2=ACCELERATION_M_S2)
    return path[1::2, :2] if len(path) > 1 else path[:, :2]


def bump(path: Array, rng: np.random.Generator) -> Array:
    """The path with a push to the side that is made good within eight ticks."""
    at = int(rng.integers(2, max(3, len(path) - 8)))
    shape = 0.03 * rng.choice([-1.0, 1.0]) * np.sin(np.linspace(0.0, np.pi, 8))
    pushed = path.copy()
    pushed[at : at + 8, 1] += shape[: len(pushed[at : at + 8])]
    return pushed


def layout(columns: dict[str, Array]) -> dict[str, object]:
    """Observation and action of the rows, and where what lies in them."""
    parts = [columns["position"], columns["scene"], columns["lamp"]]
    result = {
        "observation": np.hstack(parts),
        "action": columns["command"],
        "observation_scale": np.array([0.01, 0.01, 0.01, 0.01, 0.1]),
        "observation_names": ("x", "y", "goal.x_m", "goal.y_m", "lamp"),
        "observation_position": slice(0, 2),
        "action_position": slice(0, 2),
        "reference": slice(2, 4),
        "context": {"goal": slice(2, 4), "lamp": slice(4, 5)},
        "streams": {"robot": slice(0, 2), "camera": slice(2, 5)},
    }
    if "tool" not in columns:
        return result
    return result | {
        "observation": np.hstack([*parts, columns["tool"]]),
        "action": np.hstack([columns["command"], columns["tool_command"]]),
        "observation_scale": np.append(result["observation_scale"], TOOL_SCALE),
        "observation_names": (*result["observation_names"], *TOOL),
        "action_rotation": slice(2, 8),
        "action_gripper": slice(8, 9),
        "streams": {"robot": np.array([0, 1, *range(5, 12)]), "camera": slice(2, 5)},
    }
