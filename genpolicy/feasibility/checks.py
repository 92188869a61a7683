"""The one table of checks: name, layer, what measures it, in what unit, and how large its limit is.

A checker is made with a tuple of these rows, by default all of them. A mutant is the tuple minus
a row (`execution.checks.without`); no check can be switched off in a checker that exists.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from genpolicy.errors import ConfigError
from genpolicy.feasibility.batch import Batch, Margins
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.freshness import fresh
from genpolicy.feasibility.layers import contact, dynamic, geometric, kinematic, representation
from genpolicy.feasibility.reasons import Reason, Unit
from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import Gauge, LayerOutcome

Measure = Callable[[Batch, Cell], Margins]
Limits = Callable[[Cell, Context], Sequence[float]]

CLOSE_M = 0.1  # a distance that counts as one whole limit where the limit itself is about 0


def fresh_margins(batch: Batch, cell: Cell) -> Margins:
    """Margins of the fresh layer: 0 or -1 for what must be equal, s for what is a time."""
    found = fresh([projected.metadata for projected in batch.projected], batch.contexts)
    return Margins({name: np.array([m[name] for m in found]) for name in found[0]} if found else {})


def _one(cell: Cell) -> float:
    return 1.0


def _close(cell: Cell) -> float:
    return CLOSE_M


def _none(cell: Cell, context: Context) -> Sequence[float]:
    return ()


def _clearance(cell: Cell, context: Context) -> Sequence[float]:
    inside = context.phase in cell.contact_phases
    return (cell.settings.contact_clearance_m if inside else cell.settings.clearance_m,)


def _age(cell: Cell, context: Context) -> Sequence[float]:
    return (context.maximum_age_s,)


@dataclass(frozen=True)
class Check:
    """One row of the table.

    Attributes:
        name: The check, which is the reason that it gives.
        layer: Layer that it belongs to.
        measure: Gives its margin; rows that share one are measured together.
        unit: Unit of the margin.
        limit: What the margin is counted from, in its unit: one number, or one of each joint; none
            where it asks for yes or no, or for a region.
        scale: Size of its limit in the margin's unit, to tell which check of a layer is tightest.
        undefined: What a margin that is no number says.
    """

    name: Reason
    layer: str
    measure: Measure
    unit: Unit = Unit.NONE
    limit: Limits = _none
    scale: Callable[[Cell], float] = _one
    undefined: LayerOutcome = LayerOutcome.UNKNOWN

    def gauge(self, cell: Cell) -> Gauge:
        """How its margin is read in a cell."""
        return Gauge(self.scale(cell), self.unit, self.undefined)


_R, _U = Reason, Unit
CHECKS: tuple[Check, ...] = (
    Check(_R.SHAPE, "representation", representation.margins, _U.ACTIONS,
          lambda cell, _: (cell.settings.maximum_actions,)),
    Check(_R.FINITE, "representation", representation.margins, undefined=LayerOutcome.FAILED),
    Check(_R.ROTATION_DEGENERATE, "representation", representation.margins,
          undefined=LayerOutcome.FAILED),
    Check(_R.ROTATION_NOT_ORTHONORMAL, "representation", representation.margins, _U.NONE,
          lambda cell, _: (cell.settings.orthonormality_tolerance,),
          lambda cell: cell.settings.orthonormality_tolerance),
    Check(_R.GRIPPER_RANGE, "representation", representation.margins, _U.M,
          lambda cell, _: (cell.settings.gripper_lower_m - cell.settings.gripper_tolerance_m,
                           cell.settings.gripper_upper_m + cell.settings.gripper_tolerance_m),
          lambda cell: cell.settings.gripper_upper_m),
    Check(_R.PROJECTION_TOO_LARGE, "representation", representation.margins, _U.M_OR_RAD,
          lambda cell, _: (cell.settings.position_change_limit_m,
                           cell.settings.rotation_change_limit_rad),
          lambda cell: cell.settings.position_change_limit_m),
    Check(_R.WORKSPACE, "kinematic", kinematic.margins, _U.M, scale=_close),
    Check(_R.UNREACHABLE, "kinematic", kinematic.margins, _U.M_OR_RAD,
          lambda cell, _: (cell.settings.position_tolerance_m,
                           cell.settings.rotation_tolerance_rad),
          lambda cell: cell.settings.position_tolerance_m),
    Check(_R.START_POSE, "kinematic", kinematic.margins, _U.M_OR_RAD,
          lambda cell, _: (cell.settings.position_tolerance_m,
                           cell.settings.rotation_tolerance_rad),
          lambda cell: cell.settings.position_tolerance_m),
    Check(_R.JOINT_POSITION, "kinematic", kinematic.margins, _U.RAD,
          lambda cell, _: (cell.settings.joint_margin_rad,)),
    Check(_R.SINGULAR, "kinematic", kinematic.margins, _U.NONE,
          lambda cell, _: (cell.settings.condition_limit,),
          lambda cell: cell.settings.condition_limit),
    Check(_R.BRANCH_JUMP, "kinematic", kinematic.margins, _U.RAD,
          lambda cell, _: (cell.settings.branch_limit_rad,)),
    Check(_R.SCENE_COLLISION, "geometric", geometric.margins, _U.M, _clearance, _close),
    Check(_R.SELF_COLLISION, "geometric", geometric.margins, _U.M, _clearance, _close),
    Check(_R.SWEPT_COLLISION, "geometric", geometric.swept_margins, _U.M, _clearance, _close),
    Check(_R.MEASURED_COLLISION, "geometric", geometric.measured_margins, _U.M,
          lambda cell, _: (0.0,), _close),
    Check(_R.ACTION_PERIOD, "dynamic", dynamic.margins, _U.S,
          lambda cell, _: (cell.action_period_s,)),
    Check(_R.JOINT_VELOCITY, "dynamic", dynamic.margins, _U.RAD_S,
          lambda cell, _: cell.usable_limits.velocity_rad_s.tolist(),
          lambda cell: float(cell.limits.velocity_rad_s.min())),
    Check(_R.JOINT_ACCELERATION, "dynamic", dynamic.margins, _U.RAD_S2,
          lambda cell, _: cell.usable_limits.acceleration_rad_s2.tolist(),
          lambda cell: float(cell.limits.acceleration_rad_s2.min())),
    Check(_R.JOINT_JERK, "dynamic", dynamic.margins, _U.RAD_S3,
          lambda cell, _: cell.usable_limits.jerk_rad_s3.tolist(),
          lambda cell: float(cell.limits.jerk_rad_s3.min())),
    Check(_R.TCP_SPEED, "dynamic", dynamic.margins, _U.M_S,
          lambda cell, _: (cell.settings.tcp_speed_limit_m_s,)),
    Check(_R.TCP_TURN, "dynamic", dynamic.margins, _U.RAD_S,
          lambda cell, _: (cell.settings.tcp_turn_limit_rad_s,)),
    Check(_R.JOINT_TORQUE, "dynamic", dynamic.margins, _U.NM,
          lambda cell, _: cell.limits.torque_nm.tolist(),
          lambda cell: float(cell.limits.torque_nm.min())),
    Check(_R.PAYLOAD_TORQUE, "dynamic", dynamic.margins, _U.NM,
          lambda cell, _: cell.limits.torque_nm.tolist(),
          lambda cell: float(cell.limits.torque_nm.min())),
    Check(_R.MEASURED_VELOCITY, "dynamic", dynamic.margins, _U.RAD_S,
          lambda cell, _: cell.limits.velocity_rad_s.tolist(),
          lambda cell: float(cell.limits.velocity_rad_s.min())),
    Check(_R.MEASURED_ACCELERATION, "dynamic", dynamic.margins, _U.RAD_S2,
          lambda cell, _: cell.limits.acceleration_rad_s2.tolist(),
          lambda cell: float(cell.limits.acceleration_rad_s2.min())),
    Check(_R.STATE_AGE, "dynamic", dynamic.margins, _U.S, _age),
    Check(_R.CONTROLLER_MODE, "dynamic", dynamic.margins),
    Check(_R.APPROACH_DIRECTION, "contact", contact.margins, _U.M,
          lambda cell, _: (cell.settings.step_tolerance_m,)),
    Check(_R.CONTACT_SPEED, "contact", contact.margins, _U.M_S,
          lambda cell, _: (cell.settings.contact_speed_limit_m_s,)),
    Check(_R.GRIPPER_OPENING, "contact", contact.margins, _U.M,
          lambda cell, _: (cell.settings.held_opening_m,)),
    Check(_R.CONTACT_SURFACE, "contact", contact.surface_margins, _U.M, _clearance, _close),
    Check(_R.CONTACT_FORCE, "contact", contact.force_margins, _U.N,
          lambda cell, context: (cell.force_envelope_n.get(context.phase, 0.0),),
          lambda cell: cell.settings.contact_force_limit_n),
    Check(_R.SESSION_EPOCH, "fresh", fresh_margins),
    Check(_R.CALIBRATION_MISMATCH, "fresh", fresh_margins),
    Check(_R.PHASE_TRANSITION, "fresh", fresh_margins),
    Check(_R.CHECKPOINT_MISMATCH, "fresh", fresh_margins),
    Check(_R.SAMPLER_MISMATCH, "fresh", fresh_margins),
    Check(_R.FUTURE_OBSERVATION, "fresh", fresh_margins, _U.S, lambda cell, _: (0.0,)),
    Check(_R.BEHIND_ACCEPTED, "fresh", fresh_margins, _U.S, lambda cell, _: (0.0,)),
    Check(_R.STALE_OBSERVATION, "fresh", fresh_margins, _U.S, _age),
    Check(_R.EXPIRED, "fresh", fresh_margins, _U.S, lambda cell, _: (0.0,)),
)  # fmt: skip
"""Every check, in the order in which they decide."""


def require_table(checks: tuple[Check, ...]) -> None:
    """Refuse a tuple that is no table of checks.

    Raises:
        ConfigError: It is empty, holds a name twice, one that is no reason, or a layer that does
            not exist.
    """
    names = [check.name for check in checks]
    closed = all(isinstance(name, Reason) for name in names)
    layers = {check.layer for check in checks}
    if not names or not closed or len(set(names)) < len(names) or layers - set(LAYERS):
        raise ConfigError(
            where="the table of checks",
            found=str([(check.layer, str(check.name)) for check in checks]),
            expected=f"at least one row, each name once and out of `reasons.Reason`, layers out of "
            f"{list(LAYERS)}",
            action="Start from CHECKS; a reason of your own is a member of `Reason` first.",
        )
