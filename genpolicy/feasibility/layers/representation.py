"""The representation layer: is it a chunk at all, and did projection leave it nearly alone?"""

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, GRIPPER, ROTATION
from genpolicy.contract.chunk import Projected
from genpolicy.contract.rotation import orthonormality_error
from genpolicy.feasibility.batch import Batch, Margins
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.kernels.turn import from_rows
from genpolicy.feasibility.settings import FeasibilitySettings

Array = NDArray[np.float64]

CHECKED = (
    "shape", "finite", "rotation_degenerate", "rotation_not_orthonormal", "gripper_range",
    "projection_too_large",
)  # fmt: skip


def margins(batch: Batch, cell: Cell) -> Margins:
    """Margins of the raw chunk and of the change that projection made to it.

    ============================  =============================================================
    shape                         min(most actions - K, executable rows - 1), actions; -1 where
                                  the array is not of shape (K, D_a)
    finite                        0, or NaN where a number is NaN or infinite
    rotation_degenerate           0, or NaN where six numbers span no rotation
    rotation_not_orthonormal      tolerance - largest error of length or right angle, 1
    gripper_range                 distance to the nearer end of the range plus tolerance, m
    projection_too_large          limit - change, of position (m) or rotation (rad), whichever
                                  used up more of its limit
    ============================  =============================================================

    Each is asked by itself; NaN where a number that it needs is none.
    """
    values = {name: np.full(len(batch), np.nan) for name in CHECKED}
    groups: dict[int, list[int]] = defaultdict(list)
    for i, (projected, context) in enumerate(zip(batch.projected, batch.contexts, strict=True)):
        values["shape"][i] = _shape_margin(projected.proposal.actions, context, cell.settings)
        if is_shaped(projected, context):
            groups[len(projected.proposal.actions)].append(i)
            values["projection_too_large"][i] = _change_margin(projected, cell.settings)
    for members in groups.values():
        raw = np.stack([batch.projected[i].proposal.actions for i in members])
        for name, margin in _margins_of(raw, cell.settings).items():
            values[name][members] = margin
    return Margins(values)


def is_shaped(projected: Projected, context: Context) -> bool:
    """The raw chunk is rows of actions, of which at least one is executable."""
    return _executable(projected.proposal.actions, context) > 0


def _executable(raw: Array, context: Context) -> int:
    """Number of rows that can be executed; 0 where the array is no chunk."""
    if raw.ndim != 2 or raw.shape[1:] != (ACTION_DIM,):
        return 0
    return len(range(raw.shape[0])[context.rows(raw.shape[0])])


def _shape_margin(raw: Array, context: Context, settings: FeasibilitySettings) -> float:
    rows = _executable(raw, context)
    return float(min(settings.maximum_actions - len(raw), rows - 1)) if rows else -1.0


def _change_margin(projected: Projected, settings: FeasibilitySettings) -> float:
    moved = settings.position_change_limit_m - projected.position_change_m
    turned = settings.rotation_change_limit_rad - projected.rotation_change_rad
    relative = moved / settings.position_change_limit_m, turned / settings.rotation_change_limit_rad
    return float(moved if relative[0] <= relative[1] else turned)


def _margins_of(raw: Array, settings: FeasibilitySettings) -> dict[str, Array]:
    """Margins of raw chunks of one shape (B, K, D_a). Shapes (B,)."""
    columns, opening, slack = raw[..., ROTATION], raw[..., GRIPPER], settings.gripper_tolerance_m
    rotation = np.empty((*raw.shape[:2], 3, 3))
    from_rows(raw, ROTATION.start, rotation)
    with np.errstate(invalid="ignore", over="ignore"):
        error = np.max(orthonormality_error(columns), axis=1)
    return {
        "finite": np.where(np.isfinite(raw).all(axis=(1, 2)), 0.0, np.nan),
        "rotation_degenerate": np.where(np.isfinite(rotation).all(axis=(1, 2, 3)), 0.0, np.nan),
        "rotation_not_orthonormal": settings.orthonormality_tolerance - error,
        "gripper_range": np.minimum(
            np.min(opening, axis=1) - settings.gripper_lower_m + slack,
            settings.gripper_upper_m + slack - np.max(opening, axis=1),
        ),
    }
