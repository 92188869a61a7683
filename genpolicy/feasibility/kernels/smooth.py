"""Least smoothing of one chunk after the other that keeps the joints within their rates."""

import numpy as np
from numpy.typing import NDArray

from genpolicy.compiled import compiled
from genpolicy.contract.action import GRIPPER
from genpolicy.feasibility.kernels.chunk import (
    AT,
    blend,
    distance,
    poses_of,
    rate_excess,
    solve_rows,
)
from genpolicy.feasibility.kernels.turn import angle, from_columns

Array = NDArray[np.float64]

LEFT_ALONE = -1


@compiled("void(f8[:,::1], f8[:,::1], f8[::1])")
def changes_of(raw: Array, actions: Array, changes: Array) -> None:
    """Largest change of position, m, and rotation, rad, of a chunk, into an array of shape (2,)."""
    before, after = np.empty((3, 3)), np.empty((3, 3))
    changes[:] = 0.0
    for row in range(len(raw)):
        from_columns(raw[row], AT, before)
        from_columns(actions[row], AT, after)
        changes[0] = max(changes[0], distance(actions[row], raw[row]))
        changes[1] = max(changes[1], angle(before, after))


@compiled(
    "i8(f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,:,::1],"
    " f8[:,::1], f8[::1], f8[::1], f8[::1])"
)
def smooth(
    turns: Array,
    offsets: Array,
    rows: Array,
    fixed: Array,
    last: Array,
    on_path: Array,
    on_fixed: Array,
    bounds: Array,
    figures: Array,
    solver: Array,
    asked: Array,
) -> int:
    """The least smoothed rows whose joint path keeps the rate limits, written over the rows.

    Args:
        turns: As of `arm.place`.
        offsets: As of `arm.place`.
        rows: Rows that can be executed. Shape (n, D_a).
        fixed: Commands before them, rad. Shape (s, J).
        last: Action commanded last. Shape (D_a,).
        on_path: Per penalty, matrix on the path. Shape (L, n, n).
        on_fixed: The same on the fixed points. Shape (L, n, s).
        bounds: As of `chunk.rate_excess`.
        figures: As of `chunk.project`.
        solver: As of `chunk.solve_rows`.
        asked: Time between points, s; part of the limits that a smoothed path may use. Shape (2,).

    Returns:
        Which penalty; -1 where none is needed or none helps.
    """
    n, s = len(rows), len(fixed)
    whole, smoothed = np.empty((s + n, fixed.shape[1])), np.empty((s + n, fixed.shape[1]))
    found, left = rows.copy(), np.empty((n, 2))
    whole[:s] = fixed
    if not solve_rows(turns, offsets, rows, whole, s, solver, left):
        return LEFT_ALONE
    if rate_excess(whole, s, bounds, asked[0]) <= 1.0:
        return LEFT_ALONE
    for rung in range(len(on_path)):
        blend(on_path[rung], on_fixed[rung], whole, s, smoothed)
        if not rate_excess(smoothed, s, bounds, asked[0]) <= asked[1]:
            continue
        if not poses_of(turns, offsets, smoothed, s, last, figures, found):
            continue
        # The joint path of the rows is not quite the smoothed one: the elbow may differ.
        reached = solve_rows(turns, offsets, found, smoothed, s, solver, left)
        if reached and rate_excess(smoothed, s, bounds, asked[0]) <= 1.0:
            rows[:, :GRIPPER] = found[:, :GRIPPER]
            return rung
    return LEFT_ALONE
