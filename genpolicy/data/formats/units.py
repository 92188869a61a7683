"""Which unit is this number in? A guess from its name and its range, never more than a guess."""

import re

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.contract import UNKNOWN_UNIT

Array = NDArray[np.float64]

STATED = {
    "m": "m", "mm": "mm", "cm": "cm", "rad": "rad", "deg": "deg", "px": "px", "n": "N", "nm": "Nm",
    "meters": "m", "metres": "m", "radians": "rad", "degrees": "deg", "pixels": "px",
}  # fmt: skip
PURE = {"quat", "quaternion", "cos", "sin", "qw", "qx", "qy", "qz", "rot", "onehot", "done"}
HANDS = {
    *("gripper", "hand", "finger", "thumb", "jaw", "pinky", "ring", "middle", "index", "grasp"),
}
JOINTS = {
    *("joint", "joints", "shoulder", "elbow", "wrist", "hip", "knee", "ankle", "waist", "qpos"),
    *("forearm", "arm", "pan", "lift", "flex", "roll", "pitch", "yaw", "torso", "neck", "head"),
}
ANGLES = {"angle", "theta", "heading", "rotation", "orientation", "euler", "rpy", "axisangle"}
PLACES = {"pos", "position", "xyz", "xy", "x", "y", "z", "eef", "ee", "tcp", "pose", "location"}
PIXELS = {"pixel", "pixels", "keypoint", "keypoints", "image", "agent", "cursor", "mouse"}
SPEEDS = {"vel", "velocity", "speed", "qvel"}
FORCES, TORQUES = {"force", "wrench", "ft"}, {"torque", "effort", "current"}

BULK = (0.002, 0.998)
FULL_TURN_RAD = 2.0 * np.pi
TURNS_RAD = 3.0 * FULL_TURN_RAD
DEGREES = 540.0
REACH_M = 5.0
# Most of a column lies within this, or its name says another unit than its numbers have: no sensor
# is wider, and no hall is longer.
MOST = {"px": 20_000.0, "m": 100.0, "cm": 10_000.0, "mm": 100_000.0}


def tokens(name: str) -> list[str]:
    """The words and numbers of a name, lower case: camel case, signs and digits part them."""
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)
    return [word.lower() for word in words if word != "k"]


def stated_unit(name: str) -> str | None:
    """The unit that ends a name (`x_m`, `angle_rad`), if one does."""
    words = tokens(name)
    return STATED.get(words[-1]) if len(words) > 1 else None


def guess_unit(column: str, component: str, values: Array) -> str:
    """Unit of one number.

    Args:
        column: Name of its column.
        component: Its own name; empty if it has none.
        values: Its values, of a sample of episodes. Shape (n,).

    Returns:
        A unit, `1` for a pure number, `unknown` where nothing tells.
    """
    words = {*tokens(column), *tokens(component)}
    stated = stated_unit(component) or stated_unit(column)
    finite = values[np.isfinite(values)]
    if not len(finite):
        return stated or UNKNOWN_UNIT
    # A single wild number must not decide the unit of all others.
    low, high = np.quantile(finite, BULK)
    unit = stated or _by_words(words, float(low), float(high))
    # Nor must episodes in another unit than the rest.
    beyond = float(np.median(np.abs(finite))) > MOST.get(unit, np.inf)
    return UNKNOWN_UNIT if beyond else unit


def _by_words(words: set[str], low: float, high: float) -> str:
    largest = max(abs(low), abs(high))
    unit = UNKNOWN_UNIT
    if words & SPEEDS:
        unit = "rad/s" if words & (JOINTS | ANGLES) else UNKNOWN_UNIT
    elif words & FORCES:
        unit = "N"
    elif words & TORQUES:
        unit = UNKNOWN_UNIT
    elif _is_pure(words, low, largest):
        unit = "1"
    elif words & (ANGLES | JOINTS):
        unit = _angle(largest)
    elif words & PIXELS and largest > REACH_M:
        unit = "px"
    elif words & PLACES and largest <= REACH_M:
        unit = "m"
    return unit


def _is_pure(words: set[str], low: float, largest: float) -> bool:
    """Parts of a rotation, or a hand from open to closed."""
    hand = bool(words & HANDS) and low >= -1e-3
    return largest <= 1.0 + 1e-3 and (hand or bool(words & PURE))


def _angle(largest: float) -> str:
    """Radians while a few turns explain the range, else degrees."""
    if largest <= TURNS_RAD:
        return "rad"
    return "deg" if largest <= DEGREES else UNKNOWN_UNIT


def is_wrapped_angle(values: Array, episode: NDArray[np.int64]) -> bool:
    """Whether numbers jump by about a turn between rows, as an angle in [0, 2 pi) does.

    Args:
        values: Shape (n,).
        episode: Which episode each belongs to. Shape (n,).
    """
    inside = np.diff(episode) == 0
    step = np.abs(np.diff(values))[inside]
    low, high = float(values.min()), float(values.max())
    half = FULL_TURN_RAD / 2.0 + 1e-3
    within = (low >= -half and high <= half) or (low >= -1e-3 and high <= 2.0 * half)
    return bool(within and np.any(step > 0.9 * FULL_TURN_RAD))


def turns(values: Array) -> float:
    """How many turns an angle in radians spans."""
    return float(np.ptp(values) / FULL_TURN_RAD)
