"""Candidates of synthetic evidence, each with the margins that its verdict follows from."""

import pandas as pd

from gates.asked_for import CHECKS_ASKED_FOR
from gates.feasibility.settings import FAILED, LAYERS, NOT_REACHED, PASSED
from genpolicy.feasibility.checks import CHECKS

UNITS = {str(check.name): str(check.unit) for check in CHECKS}
OWN = {
    layer: next(n for at, _, n in (row.partition(".") for row in CHECKS_ASKED_FOR) if at == layer)
    for layer in LAYERS
}
"""For what a layer rejects where nobody says it: the first of its checks."""
LEFT = {
    "representation": ("gripper_range", 0.01, 0.25), "kinematic": ("joint_position", 0.4, 0.4),
    "geometric": ("swept_collision", 0.02, 0.2), "dynamic": ("joint_velocity", 0.6, 0.3),
    "contact": ("", None, None), "fresh": ("stale_observation", 0.25, 0.25),
}  # fmt: skip
"""Of a layer that passed: its closest check, what is left to the limit, and as a share of it."""
TIGHTEST = "geometric"
BEYOND = -0.1
STATED = [
    "margin_layer", "margin_check", "layer_margin", "margin_unit",
    *(f"{what}_{layer}" for what in ("outcome", "check", "margin", "unit", "share", "row")
      for layer in LAYERS),
]  # fmt: skip
VERDICT = [*LAYERS, "outcome", "first_reason", "first_row"]


def as_the_layers_say(before: pd.DataFrame, frame: pd.DataFrame) -> pd.DataFrame:
    """Margins that follow from the verdicts, where an edit sets those alone.

    A layer behind one that rejects was not reached, and the outcome is that of the layers; where
    an edit states margins itself, they are left as they are.
    """
    if {*VERDICT, *STATED} - set(frame):
        return frame
    if not frame[STATED].equals(before[STATED].reindex(frame.index)):
        return frame
    return said_of(frame)


def said_of(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with what the layers state, by its flags, outcome and first reason."""
    found = {name: frame[name].astype(object).tolist() for name in VERDICT}
    found |= {name: [None] * len(frame) for name in STATED}
    for place in range(len(frame)):
        row = {name: found[name][place] for name in VERDICT}
        for name, value in _judged(row).items():
            found[name][place] = value
    columns = {name: pd.Series(values, frame.index, dtype=object) for name, values in found.items()}
    return frame.assign(**columns)


def _judged(row: dict) -> dict:
    """What the columns of one candidate say, by its verdict."""
    rejecting = next((name for name in LAYERS if row[name] is not True), None)
    if rejecting is None and row["outcome"] != PASSED:
        rejecting = LAYERS[-1]
    if rejecting is None:
        return _passed()
    place, outcome = LAYERS.index(rejecting), row["outcome"]
    reason = row["first_reason"]
    if outcome == PASSED:
        outcome, reason = FAILED, reason or OWN[rejecting]
    found = dict.fromkeys(LAYERS) | dict.fromkeys(LAYERS[:place], True) | {rejecting: False}
    for name in LAYERS[:place]:
        found |= _layer(name, PASSED, *LEFT[name])
    beyond = BEYOND if outcome == FAILED and reason else None
    first_row = None if pd.isna(row["first_row"]) else int(row["first_row"])
    found |= _layer(rejecting, outcome, reason, beyond, beyond) | {f"row_{rejecting}": first_row}
    for name in LAYERS[place + 1 :]:
        found |= _layer(name, NOT_REACHED, "", None, None)
    return found | {
        "outcome": outcome, "first_reason": reason, "first_row": first_row,
        "margin_layer": rejecting, "margin_check": reason, "layer_margin": beyond,
        "margin_unit": found[f"unit_{rejecting}"],
    }  # fmt: skip


def _passed() -> dict:
    found = dict.fromkeys(LAYERS, True) | {"outcome": PASSED, "first_row": None}
    for name in LAYERS:
        found |= _layer(name, PASSED, *LEFT[name])
    check, margin, _ = LEFT[TIGHTEST]
    return found | {
        "margin_layer": TIGHTEST, "margin_check": check, "layer_margin": margin,
        "margin_unit": UNITS[check],
    }  # fmt: skip


def _layer(name: str, outcome: str, check: str, margin: float | None, share: float | None) -> dict:
    return {
        f"outcome_{name}": outcome, f"check_{name}": check, f"margin_{name}": margin,
        f"unit_{name}": UNITS.get(check, "1") if check else "", f"share_{name}": share,
        f"row_{name}": None,
    }  # fmt: skip
