"""Causes outside the route: modes of rotation, of the gripper's time and of speed, and no modes.

One route in all of them. Where modes are planted, they are two; a free choice between the same ends
is a continuous family, which is no mode, and neither is a variable that decides a yaw.
"""

from math import radians

from benchmarks.audit.catalogue import HALF, NOISE, SUPPORT, UNIMODAL, VALID, Cause, hidden
from benchmarks.audit.plan import Plan

_WEAK = (UNIMODAL, SUPPORT, NOISE)


def _degrees(seed: int, strength: float, **more) -> Plan:
    return Plan(seed, shares=HALF, differ="rotation", apart=radians(strength), **more)


ACTIONS = (
    Cause(
        "modes of rotation", "valid_modes", "degrees", (5, 15, 40, 90, 120), 40,
        "five times the operator's spread to either side, and well beyond the declared 9 degrees",
        lambda seed, s, task: _degrees(seed, s), (VALID,), _WEAK,
    ),
    Cause(
        "modes of gripper time", "valid_modes", "share of the path", (0.05, 0.15, 0.3, 0.5), 0.3,
        "at 35 or at 65 % of the path: five times the operator's spread to either side",
        lambda seed, s, task: Plan(seed, shares=HALF, differ="gripper", apart=s),
        (VALID,), _WEAK,
    ),
    Cause(
        "modes of speed", "valid_modes", "factor", (1.1, 1.4, 2.5, 3.5), 2.5,
        "operators and episodes differ by a factor of 1.6 without any mode",
        lambda seed, s, task: Plan(seed, shares=HALF, differ="timing", apart=s),
        (VALID,), _WEAK,
    ),
    Cause(
        "a free yaw", "unimodal", "degrees from end to end", (30, 60, 120), 0,
        "every yaw between the ends alike: not two",
        lambda seed, s, task: _degrees(seed, s, free=True), (UNIMODAL,),
    ),
    Cause(
        "a free gripper time", "unimodal", "share of the path from end to end", (0.15, 0.3, 0.5), 0,
        "every time between the ends alike: not two",
        lambda seed, s, task: Plan(seed, shares=HALF, differ="gripper", apart=s, free=True),
        (UNIMODAL,),
    ),
    Cause(
        "a free speed", "unimodal", "factor from end to end", (1.4, 2.5), 0,
        "every speed between the ends alike: not two",
        lambda seed, s, task: Plan(seed, shares=HALF, differ="timing", apart=s, free=True),
        (UNIMODAL,),
    ),
    Cause(
        "hidden operator turns the tool", "hidden_state", "share of episodes that obey",
        (0.3, 0.8, 1.0), 0.8, "it then predicts 9 of 10 modes and explains half of their entropy",
        lambda seed, s, task: _degrees(seed, 90, decided_by="operator", fidelity=s),
        (hidden("operator"),), (VALID,),
    ),
)  # fmt: skip
