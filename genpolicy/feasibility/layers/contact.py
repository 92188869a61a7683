"""The contact layer: towards the target straight down, slowly and not too hard, and nowhere else.

What is held is let go where that is meant.
"""

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION
from genpolicy.feasibility.batch import Batch, Margins
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.layers.geometric import depth_m, detail_of, from_measured, paths_of
from genpolicy.robot.impedance import STIFFNESS_N_M
from genpolicy.robot.pressing import pressed_depth_m

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

ROUNDING = 1e-6  # relative; a step that was limited to its limit must not fail by rounding


def margins(batch: Batch, cell: Cell) -> Margins:
    """Margins while the object is held in a contact phase, and of letting go in any phase.

    ====================  =====================================================================
    approach_direction    min of (step_tolerance + tan(cone) * down - lateral) and
                          (step_tolerance - up) of every step, m
    contact_speed         limit - |step| / T, m/s
    gripper_opening       held_opening - opening where the gripper lets go outside the opening
                          phases and, in a contact phase, above the release depth, m
    ====================  =====================================================================

    Where a check does not apply its margin is 0. A gripper that never moves lets nothing go, so
    a task without opening phases passes as long as its opening stays as it is.
    """
    settings, steps = cell.settings, batch.steps_m
    in_contact = batch.in_phases(cell.contact_phases)
    held = batch.held(settings.held_opening_m)
    down = np.maximum(-steps[..., 2], 0.0)
    lateral = np.linalg.norm(steps[..., :2], axis=2)
    cone = settings.step_tolerance_m + np.tan(settings.approach_cone_rad) * down - lateral
    upward = settings.step_tolerance_m - np.maximum(steps[..., 2], 0.0)
    speed = settings.contact_speed_limit_m_s * (1 + ROUNDING) - (
        np.linalg.norm(steps, axis=2) / cell.action_period_s
    )
    applies = in_contact[:, None] & held[:, 1:]
    return Margins({
        "approach_direction": _smallest(np.minimum(cone, upward), applies),
        "contact_speed": _smallest(speed, applies),
        "gripper_opening": _opening(batch, cell, held, in_contact),
    })  # fmt: skip


def surface_margins(batch: Batch, cell: Cell) -> Margins:
    """What is held touches nothing but the target, at the rows, on the way there and between them.

    ====================  =====================================================================
    contact_surface       in a contact phase: lower bound on distance - clearance to all of the
                          scene but the target, m; - depth (at least 1 nm) of a hit
    ====================  =====================================================================

    Outside the contact phases the geometric layer asks for what is held too; the margin is 0 here.
    """
    found, details = np.zeros(len(batch)), [""] * len(batch)
    inside = np.flatnonzero(batch.in_phases(cell.contact_phases))
    if len(inside):
        some = batch.take(inside)
        paths, came = paths_of(some, cell, "held"), from_measured(some, cell, "held")
        sweep = cell.collision.check_swept
        reports = cell.collision.check_samples(paths), sweep(paths), sweep(came)
        for place, i in enumerate(inside):
            found[i] = min(float(report.clearance_m[place]) for report in reports)
            hit = next((r.hits[place] for r in reports if r.hits[place] is not None), None)
            if hit is not None:
                found[i], details[i] = -depth_m(hit), detail_of(hit)
    return Margins({"contact_surface": found}, tuple(details))


def force_margins(batch: Batch, cell: Cell) -> Margins:
    """What is held is not pressed into the target harder than the phase allows.

    ====================  =====================================================================
    contact_force         limit of the phase - stiffness * deepest commanded depth in the target, N
    ====================  =====================================================================

    A lower bound of the force (`robot.pressing`). Outside the contact phases it is 0: there the
    geometric layer allows no touch.

    Source:
        The controller is a spring of `impedance.STIFFNESS_N_M` between command and arm.
    """
    found = np.zeros(len(batch))
    inside = np.flatnonzero(batch.in_phases(cell.contact_phases))
    if len(inside):
        some = batch.take(inside)
        depth = pressed_depth_m(cell.collision, paths_of(some, cell, "held"))
        limits = np.array([cell.force_envelope_n[context.phase] for context in some.contexts])
        found[inside] = limits - STIFFNESS_N_M * depth
    return Margins({"contact_force": found})


def _opening(batch: Batch, cell: Cell, held: BoolArray, in_contact: BoolArray) -> Array:
    settings = cell.settings
    free = batch.in_phases(cell.opening_phases)
    deep = in_contact[:, None] & (_depth_m(batch, cell) >= settings.release_depth_m)
    # The moment of letting go: held before, open now.
    opened = held[:, :-1] & ~held[:, 1:]
    wrong = opened & ~deep & ~free[:, None]
    left = settings.held_opening_m - batch.actions[..., GRIPPER]
    return np.where(wrong.any(axis=1), _smallest(left, wrong), 0.0)


def _depth_m(batch: Batch, cell: Cell) -> Array:
    """How deep the held object's tip is in the target, m; -inf without a target. (B, n)."""
    shapes = cell.collision.shapes
    height = batch.actions[..., POSITION][..., 2]
    if not shapes.target_body:
        return np.full(height.shape, -np.inf)
    target = np.array([c.scene.target_position_m(shapes) for c in batch.contexts])
    depth: Array = target[:, None, 2] - (height - shapes.held_reach_m)
    return depth


def _smallest(margin: Array, applies: BoolArray) -> Array:
    """Smallest margin where it applies; 0 where it applies nowhere; NaN stays. Shape (B,)."""
    smallest: Array = np.min(np.where(applies, margin, np.inf), axis=1)
    return np.where(applies.any(axis=1), smallest, 0.0)
