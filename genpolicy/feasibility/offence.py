"""Which action of a chunk offends first against a check: asked afterwards, of what was rejected.

A check answers with one margin for the whole chunk. The first offending row is the last row of
the shortest beginning of the chunk that the same check, asked the same way, still refuses; so it
is true of every check by definition, whether it looks at single rows, at rates over several, or at
the motion that leads to a row. A check that every row breaks alike (the period, the mode, a clause
of freshness) offends with its first row. The search halves the chunk: a few more questions to the
check, which is why nobody asks on the way to the robot.
"""

from dataclasses import replace

import numpy as np

from genpolicy.contract.action import POSITION, ROTATION
from genpolicy.contract.chunk import Projected
from genpolicy.contract.rotation import angle_between, rotation_from_6d
from genpolicy.feasibility.batch import Batch, Solution
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.checks import Check
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.inverse import solved
from genpolicy.feasibility.layers.representation import is_shaped
from genpolicy.feasibility.settings import LAYERS


def offending_row(
    check: Check, projected: Projected, *, context: Context, cell: Cell
) -> int | None:
    """First row that offends against a check, counted from 0, late rows included.

    Args:
        check: A check that refuses the chunk, or could not be evaluated.
        projected: The chunk.
        context: What it was checked against.
        cell: Robot, scene, phases and thresholds.

    Returns:
        The row; None where the array is no chunk, all of its rows are late, or the check refuses
        none of its beginnings.
    """
    if not is_shaped(projected, context):
        return None
    if check.layer == LAYERS[0]:  # the one layer that also looks at late rows
        context = replace(context, first_index=0)
    whole = Batch((projected,), (context,))
    if check.layer in LAYERS[1:-1]:
        if not np.all(np.isfinite(whole.actions)):
            return None
        whole = solved(whole, cell)

    def refuses(rows: int) -> bool:
        margin = check.measure(_beginning(whole, rows), cell).values[check.name][0]
        return not margin >= 0

    passes, refused = 0, len(range(len(projected.actions))[context.rows(len(projected.actions))])
    if not refuses(refused):
        return None
    while refused - passes > 1:
        rows = (passes + refused) // 2
        passes, refused = (passes, rows) if refuses(rows) else (rows, refused)
    return context.first_index + refused - 1


def _beginning(whole: Batch, rows: int) -> Batch:
    """The first so many executable rows of a batch of one chunk, with all late ones."""
    (projected,), (context,) = whole.projected, whole.contexts
    end, found = context.first_index + rows, whole.solution
    raw, actions = projected.proposal.actions[:end], projected.actions[:end]
    moved, turned = projected.position_change_m, projected.rotation_change_rad
    if np.isfinite(moved) and end < len(projected.actions):
        moved, turned = _changes(raw, actions)
    return Batch(
        (Projected(replace(projected.proposal, actions=raw), actions, moved, turned),),
        whole.contexts,
        None
        if found is None
        else Solution(
            found.q_rad[:, :rows],
            found.position_error_m[:, :rows],
            found.rotation_error_rad[:, :rows],
        ),
    )


def _changes(raw: np.ndarray, actions: np.ndarray) -> tuple[float, float]:
    """Largest change of position, m, and of rotation, rad, that projection made to some rows."""
    moved = np.linalg.norm(actions[:, POSITION] - raw[:, POSITION], axis=1)
    turned = angle_between(
        rotation_from_6d(raw[:, ROTATION]), rotation_from_6d(actions[:, ROTATION])
    )
    return float(moved.max()), float(turned.max())
