"""What the tool does on one route: how it turns, when it grips, how fast it goes.

Modes may differ in one of these alone. An operator repeats each with a spread of its own; with
`free` there are no modes, and every episode draws evenly between what would be the two.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.audit.plan import Array, Plan
from genpolicy.contract.rotation import rotation_from_6d, rotation_to_6d

OPEN_M, CLOSED_M = 0.040, 0.010
TURN_SPREAD_RAD = 0.07
GRIP_SPREAD = 0.03
# The tool has turned after this share of the path; the fingers close within so many ticks.
TURNED_AT = 0.5
CLOSING_TICKS = 3
MIDDLE_OF_PATH = 0.5


@dataclass(frozen=True)
class Intent:
    """What one episode intends.

    Attributes:
        turn_rad: Angle about the vertical that the tool turns to on the way.
        grip_at: Share of the path at which the gripper closes.
        pace: Factor of the speed.
    """

    turn_rad: float
    grip_at: float
    pace: float


def intent(plan: Plan, mode: int, rng: np.random.Generator) -> Intent:
    """Draws of one episode; the first mode is the smaller one."""
    side = rng.uniform(-0.5, 0.5) if plan.free else mode - 0.5
    turn, grip, pace = (plan.apart * side if plan.differ == name else 0.0 for name in (
        "rotation", "gripper", "timing"
    ))  # fmt: skip
    if plan.differ == "timing":
        pace = side * float(np.log(plan.apart))
    if plan.tool:
        turn += TURN_SPREAD_RAD * rng.normal()
        grip += GRIP_SPREAD * rng.normal()
    return Intent(turn, MIDDLE_OF_PATH + grip, float(np.exp(pace)))


def profiles(way: Intent, command: Array, first: int, last: int) -> tuple[Array, Array]:
    """Angle (rad) and opening (m) of each tick for a path from tick `first` to tick `last`.

    Args:
        way: What is intended.
        command: Commanded positions. Shape (T, P).
        first: Tick at which the arm sets out.
        last: Tick at which it is there.

    Returns:
        Shapes (T,) and (T,).
    """
    steps = np.linalg.norm(np.diff(command, axis=0, prepend=command[:1]), axis=1)
    steps[: first + 1] = 0.0
    steps[last + 1 :] = 0.0
    along = np.cumsum(steps)
    share = along / along[-1] if along[-1] > 0.0 else along
    x = np.clip(share / TURNED_AT, 0.0, 1.0)
    angle = way.turn_rad * x * x * (3.0 - 2.0 * x)
    begin = int(np.argmax(share >= way.grip_at))
    closing = np.clip((np.arange(len(command)) - begin) / CLOSING_TICKS, 0.0, 1.0)
    return angle, OPEN_M + (CLOSED_M - OPEN_M) * closing


def turned(columns: Array, angle: Array) -> Array:
    """Six-number rotations turned about the vertical of the base. Shape (T, 6)."""
    turn = np.zeros((len(angle), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0] = np.sin(angle)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    return rotation_to_6d(turn @ rotation_from_6d(columns))
