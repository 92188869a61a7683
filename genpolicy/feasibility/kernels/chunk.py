"""Projection and smoothing of one chunk after the other (`projection`, `smoothing`)."""

import math

import numpy as np
from numpy.typing import NDArray

from genpolicy.compiled import compiled
from genpolicy.contract.action import ACTION_DIM, GRIPPER
from genpolicy.feasibility.kernels.arm import place, solve_all
from genpolicy.feasibility.kernels.turn import angle, from_columns, to_columns

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

AT = 3  # where the rotation begins in a row
ROUNDING = 1e-9  # relative: what was limited once stays
NO_CHUNK, DONE, TURNS = -1, 0, 1
"""Not finite or no rotation; projected; turns faster than it may, which is not limited here."""
RATES = 3  # velocity, acceleration, jerk


@compiled("f8(f8[::1], f8[::1])")
def distance(first: Array, second: Array) -> float:
    """Distance of the positions of two rows, m."""
    a, b, c = first[0] - second[0], first[1] - second[1], first[2] - second[2]
    return math.sqrt(a * a + b * b + c * c)


@compiled("i8(f8[:,::1], f8[::1], i8, f8[::1], f8[:,::1], f8[::1])")
def project(
    raw: Array, last: Array, begin: int, figures: Array, actions: Array, changes: Array
) -> int:
    """The geometric part of the projection of a chunk.

    Args:
        raw: Shape (K, D_a).
        last: Action commanded last. Shape (D_a,).
        begin: First row that is not late.
        figures: Workspace, lower and upper; opening, lowest and largest; longest step, m; largest
            turn, rad. Shape (10,).
        actions: Written, shape (K, D_a), unless the chunk is none.
        changes: Written: largest change of position, m, and rotation, rad. Shape (2,).

    Returns:
        What came of it.
    """
    before, after, rotated = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    changes[0] = changes[1] = np.inf
    for row in range(len(raw)):
        for i in range(ACTION_DIM):
            if not math.isfinite(raw[row, i]):
                return NO_CHUNK
        if not from_columns(raw[row], AT, before):
            return NO_CHUNK
    position = last.copy()
    known = from_columns(last, AT, after)
    moved, turned = 0.0, 0.0
    for row in range(len(raw)):
        own = actions[row]
        from_columns(raw[row], AT, rotated)
        to_columns(rotated, own, AT)
        for i in range(3):
            own[i] = min(max(raw[row, i], figures[i]), figures[3 + i])
        own[GRIPPER] = min(max(raw[row, GRIPPER], figures[6]), figures[7])
        if row >= begin:
            length = distance(own, position)
            if length > figures[8] * (1 + ROUNDING):
                for i in range(3):
                    own[i] = position[i] + (own[i] - position[i]) * (figures[8] / length)
            position[:] = own
            if known and angle(after, rotated) > figures[9] * (1 + ROUNDING):
                return TURNS
            after[:, :] = rotated
        moved = max(moved, distance(own, raw[row]))
        turned = max(turned, angle(rotated, rotated))
    changes[0], changes[1] = moved, turned
    return DONE


@compiled("void(f8[:,:,::1], f8[:,::1], i8[::1], f8[::1], f8[:,:,::1], f8[:,::1], i8[::1])")
def project_all(
    raw: Array,
    last: Array,
    begin: Integers,
    figures: Array,
    actions: Array,
    changes: Array,
    state: Integers,
) -> None:
    """`project` of B chunks."""
    for chunk in range(len(raw)):
        state[chunk] = project(
            raw[chunk], last[chunk], begin[chunk], figures, actions[chunk], changes[chunk]
        )


@compiled("f8(f8[:,::1], i8, f8[:,::1], f8)")
def rate_excess(whole: Array, fixed: int, bounds: Array, period: float) -> float:
    """Largest share of a rate limit that a path uses, as of `smoothing.rate_excess`.

    Args:
        whole: Fixed points, then the path, rad. Shape (s + n, J).
        fixed: How many are fixed.
        bounds: Velocity, acceleration, jerk, rad, s. Shape (3, J).
        period: Time between points, s.
    """
    used, rates = 0.0, whole.copy()
    for order in range(1, RATES + 1):
        for i in range(len(whole) - order):
            for joint in range(whole.shape[1]):
                rates[i, joint] = (rates[i + 1, joint] - rates[i, joint]) / period
                if i >= fixed - order:
                    used = max(used, abs(rates[i, joint]) / bounds[order - 1, joint])
    return used


@compiled("void(f8[:,::1], f8[:,::1], f8[:,::1], i8, f8[:,::1])")
def blend(on_path: Array, on_fixed: Array, whole: Array, fixed: int, result: Array) -> None:
    """The path smoothed by one penalty, behind the fixed points. Shapes (s + n, J)."""
    rows = len(whole) - fixed
    for joint in range(whole.shape[1]):
        for i in range(fixed):
            result[i, joint] = whole[i, joint]
        for i in range(rows):
            total, before = 0.0, 0.0
            for k in range(rows):
                total += on_path[i, k] * whole[fixed + k, joint]
            for k in range(fixed):
                before += on_fixed[i, k] * whole[k, joint]
            result[fixed + i, joint] = total + before


@compiled("b1(f8[:,:,::1], f8[:,::1], f8[:,::1], i8, f8[::1], f8[::1], f8[:,::1])")
def poses_of(
    turns: Array, offsets: Array, whole: Array, fixed: int, last: Array, figures: Array, rows: Array
) -> bool:
    """Poses of a joint path, into rows; whether they keep workspace, speed and turning rate."""
    joints = whole.shape[1]
    rotation, position = np.empty((joints + 1, 3, 3)), np.empty((joints + 1, 3))
    before, now, good = np.empty((3, 3)), np.empty((3, 3)), True
    known, at = from_columns(last, AT, before), last.copy()
    for row in range(len(rows)):
        place(turns, offsets, whole[fixed + row], rotation, position)
        now[:, :] = rotation[joints]
        for i in range(3):
            rows[row, i] = position[joints, i]
            good = good and figures[i] <= rows[row, i] <= figures[3 + i]
        to_columns(now, rows[row], AT)
        good = good and not distance(rows[row], at) > figures[8] * (1 + ROUNDING)
        if known or row:
            good = good and not angle(before, now) > figures[9] * (1 + ROUNDING)
        at[:], before[:, :] = rows[row], now
    return good


@compiled("b1(f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,::1], i8, f8[::1], f8[:,::1])")
def solve_rows(
    turns: Array,
    offsets: Array,
    rows: Array,
    whole: Array,
    fixed: int,
    solver: Array,
    left: Array,
) -> bool:
    """Joint positions of rows, from the last fixed point on; whether all poses are reached.

    Args:
        turns: As of `arm.place`.
        offsets: As of `arm.place`.
        rows: Shape (n, D_a).
        whole: Written behind its fixed points, rad. Shape (s + n, J).
        fixed: How many there are.
        solver: Figures of `arm.solve_all`, then most iterations. Shape (5,).
        left: Written, as of `arm.solve_all`. Shape (n, 2).
    """
    n = len(rows)
    target, target_m, q = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, whole.shape[1]))
    for row in range(n):
        from_columns(rows[row], AT, target[row])
        target_m[row] = rows[row, :AT]
        q[row] = whole[fixed - 1]
    solve_all(turns, offsets, target_m, target, q, int(solver[4]), solver, left)
    reached = True
    for row in range(n):
        whole[fixed + row] = q[row]
        reached = reached and left[row, 0] <= solver[2] and left[row, 1] <= solver[3]
    return reached
