"""The one table of checks: name, layer, what measures it, and the size of its limit.

A checker is made with a tuple of these rows, by default all of them. A mutant is the tuple minus
a row (`execution.checks.without`); no check can be switched off in a checker that exists.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from genpolicy.errors import ConfigError
from genpolicy.feasibility.batch import Batch, Margins
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.freshness import fresh
from genpolicy.feasibility.layers import contact, dynamic, geometric, kinematic, representation
from genpolicy.feasibility.settings import LAYERS

Measure = Callable[[Batch, Cell], Margins]

CLOSE_M = 0.1  # a distance that counts as one whole limit where the limit itself is about 0


def fresh_margins(batch: Batch, cell: Cell) -> Margins:
    """Margins of the fresh layer: 0 or -1 for what must be equal, s for what is a time."""
    pairs = zip(batch.projected, batch.contexts, strict=True)
    found = [fresh(projected.metadata, context) for projected, context in pairs]
    return Margins({name: np.array([m[name] for m in found]) for name in found[0]} if found else {})


def _one(cell: Cell) -> float:
    return 1.0


def _close(cell: Cell) -> float:
    return CLOSE_M


@dataclass(frozen=True)
class Check:
    """One row of the table.

    Attributes:
        name: Name of the check, which is the reason that it gives.
        layer: Layer that it belongs to.
        measure: Gives its margin; rows that share one are measured together.
        scale: Size of its limit in the margin's unit, to tell which check of a layer is tightest.
    """

    name: str
    layer: str
    measure: Measure
    scale: Callable[[Cell], float] = _one


CHECKS: tuple[Check, ...] = (
    Check("shape", "representation", representation.margins),
    Check("finite", "representation", representation.margins),
    Check("rotation_degenerate", "representation", representation.margins),
    Check("rotation_not_orthonormal", "representation", representation.margins,
          lambda cell: cell.settings.orthonormality_tolerance),
    Check("gripper_range", "representation", representation.margins,
          lambda cell: cell.settings.gripper_upper_m),
    Check("projection_too_large", "representation", representation.margins,
          lambda cell: cell.settings.position_change_limit_m),
    Check("workspace", "kinematic", kinematic.margins, _close),
    Check("unreachable", "kinematic", kinematic.margins,
          lambda cell: cell.settings.position_tolerance_m),
    Check("joint_position", "kinematic", kinematic.margins),
    Check("singular", "kinematic", kinematic.margins, lambda cell: cell.settings.condition_limit),
    Check("scene_collision", "geometric", geometric.margins, _close),
    Check("self_collision", "geometric", geometric.margins, _close),
    Check("swept_collision", "geometric", geometric.swept_margins, _close),
    Check("measured_collision", "geometric", geometric.measured_margins, _close),
    Check("action_period", "dynamic", dynamic.margins),
    Check("joint_velocity", "dynamic", dynamic.margins,
          lambda cell: float(cell.limits.velocity_rad_s.min())),
    Check("joint_acceleration", "dynamic", dynamic.margins,
          lambda cell: float(cell.limits.acceleration_rad_s2.min())),
    Check("joint_jerk", "dynamic", dynamic.margins,
          lambda cell: float(cell.limits.jerk_rad_s3.min())),
    Check("tcp_speed", "dynamic", dynamic.margins),
    Check("tcp_turn", "dynamic", dynamic.margins),
    Check("joint_torque", "dynamic", dynamic.margins,
          lambda cell: float(cell.limits.torque_nm.min())),
    Check("payload_torque", "dynamic", dynamic.margins,
          lambda cell: float(cell.limits.torque_nm.min())),
    Check("measured_velocity", "dynamic", dynamic.margins,
          lambda cell: float(cell.limits.velocity_rad_s.min())),
    Check("measured_acceleration", "dynamic", dynamic.margins,
          lambda cell: float(cell.limits.acceleration_rad_s2.min())),
    Check("state_age", "dynamic", dynamic.margins),
    Check("controller_mode", "dynamic", dynamic.margins),
    Check("approach_direction", "contact", contact.margins),
    Check("contact_speed", "contact", contact.margins),
    Check("gripper_opening", "contact", contact.margins),
    Check("contact_surface", "contact", contact.surface_margins, _close),
    Check("contact_force", "contact", contact.force_margins,
          lambda cell: cell.settings.contact_force_limit_n),
    Check("session_epoch", "fresh", fresh_margins),
    Check("calibration_mismatch", "fresh", fresh_margins),
    Check("phase_transition", "fresh", fresh_margins),
    Check("checkpoint_mismatch", "fresh", fresh_margins),
    Check("sampler_mismatch", "fresh", fresh_margins),
    Check("future_observation", "fresh", fresh_margins),
    Check("behind_accepted", "fresh", fresh_margins),
    Check("stale_observation", "fresh", fresh_margins),
    Check("expired", "fresh", fresh_margins),
)  # fmt: skip
"""Every check, in the order in which they decide."""


def require_table(checks: tuple[Check, ...]) -> None:
    """Refuse a tuple that is no table of checks.

    Raises:
        ConfigError: It is empty, holds a name twice, or a layer that does not exist.
    """
    names = [check.name for check in checks]
    if not names or len(set(names)) < len(names) or {c.layer for c in checks} - set(LAYERS):
        raise ConfigError(
            where="the table of checks",
            found=str([(check.layer, check.name) for check in checks]),
            expected=f"at least one row, each name once, layers out of {list(LAYERS)}",
            action="Start from CHECKS.",
        )
