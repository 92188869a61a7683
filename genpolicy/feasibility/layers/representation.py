"""The representation layer: is it a chunk at all, and did projection leave it nearly alone?"""

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, GRIPPER, ROTATION
from genpolicy.contract.chunk import Projected
from genpolicy.contract.rotation import orthonormality_error, rotation_from_6d
from genpolicy.feasibility.batch import Batch, Margins
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.context import Context
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
    found = [
        _margins_of(projected, context, cell.settings)
        for projected, context in zip(batch.projected, batch.contexts, strict=True)
    ]
    return Margins({name: np.array([m.get(name, np.nan) for m in found]) for name in CHECKED})


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


def _margins_of(
    projected: Projected, context: Context, settings: FeasibilitySettings
) -> dict[str, float]:
    raw = projected.proposal.actions
    result = {"shape": _shape_margin(raw, context, settings)}
    if not is_shaped(projected, context):
        return result
    result["finite"] = 0.0 if np.all(np.isfinite(raw)) else float("nan")
    columns = raw[:, ROTATION]
    with np.errstate(invalid="ignore", over="ignore"):
        degenerate = not np.all(np.isfinite(rotation_from_6d(columns)))
        error = float(np.max(orthonormality_error(columns)))
    result["rotation_degenerate"] = float("nan") if degenerate else 0.0
    result["rotation_not_orthonormal"] = settings.orthonormality_tolerance - error
    opening, slack = raw[:, GRIPPER], settings.gripper_tolerance_m
    result["gripper_range"] = float(
        min(
            np.min(opening) - settings.gripper_lower_m + slack,
            settings.gripper_upper_m + slack - np.max(opening),
        )
    )
    moved = settings.position_change_limit_m - projected.position_change_m
    turned = settings.rotation_change_limit_rad - projected.rotation_change_rad
    relative = moved / settings.position_change_limit_m, turned / settings.rotation_change_limit_rad
    result["projection_too_large"] = float(moved if relative[0] <= relative[1] else turned)
    return result
