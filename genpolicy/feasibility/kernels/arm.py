"""Forward and inverse kinematics of one configuration after the other (`robot.kinematics`)."""

import math

import numpy as np
from numpy.typing import NDArray

from genpolicy.compiled import compiled

Array = NDArray[np.float64]

TINY = 1e-12  # below it a norm is no length to divide by
AXIS_LOST, HALF_TURN = 1e-9, 1.0  # as in `robot.frames.pose_error`
POSE = 6


@compiled("void(f8[:,:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,::1])")
def place(turns: Array, offsets: Array, q: Array, rotation: Array, position: Array) -> None:
    """Frames of one configuration.

    Args:
        turns: Fixed rotations before each joint and the TCP. Shape (J + 1, 3, 3).
        offsets: Fixed translations, m. Shape (J + 1, 3).
        q: Joint positions, rad. Shape (J,).
        rotation: Written. Shape (J + 1, 3, 3).
        position: Written, m. Shape (J + 1, 3).
    """
    joints = len(q)
    for joint in range(joints + 1):
        own, at = turns[joint], offsets[joint]
        c, s = 1.0, 0.0
        if joint < joints:
            c, s = math.cos(q[joint]), math.sin(q[joint])
        for i in range(3):
            if joint == 0:
                x, y, z = own[i, 0], own[i, 1], own[i, 2]
                position[0, i] = at[i]
            else:
                before = rotation[joint - 1]
                a, b, d = before[i, 0], before[i, 1], before[i, 2]
                x = a * own[0, 0] + b * own[1, 0] + d * own[2, 0]
                y = a * own[0, 1] + b * own[1, 1] + d * own[2, 1]
                z = a * own[0, 2] + b * own[1, 2] + d * own[2, 2]
                position[joint, i] = position[joint - 1, i] + a * at[0] + b * at[1] + d * at[2]
            rotation[joint, i, 0] = x * c + y * s
            rotation[joint, i, 1] = y * c - x * s
            rotation[joint, i, 2] = z


@compiled("void(f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,:,:,::1], f8[:,:,::1])")
def place_all(turns: Array, offsets: Array, q: Array, rotation: Array, position: Array) -> None:
    """`place` of N configurations, into arrays of shape (N, J + 1, 3, 3) and (N, J + 1, 3)."""
    for i in range(len(q)):
        place(turns, offsets, q[i], rotation[i], position[i])


@compiled("void(f8[:,:,::1], f8[:,::1], f8[:,::1])")
def jacobian(rotation: Array, position: Array, result: Array) -> None:
    """Jacobian of the TCP, linear over angular rows, into an array of shape (6, J)."""
    joints = result.shape[1]
    for joint in range(joints):
        x, y, z = rotation[joint, 0, 2], rotation[joint, 1, 2], rotation[joint, 2, 2]
        a = position[joints, 0] - position[joint, 0]
        b = position[joints, 1] - position[joint, 1]
        c = position[joints, 2] - position[joint, 2]
        result[0, joint] = y * c - z * b
        result[1, joint] = z * a - x * c
        result[2, joint] = x * b - y * a
        result[3, joint], result[4, joint], result[5, joint] = x, y, z


@compiled("void(f8[:,::1], f8[::1], f8[::1], f8[:,::1], f8[::1])")
def pose_error(tcp: Array, at_m: Array, target_m: Array, target: Array, error: Array) -> None:
    """Position (m) and rotation vector (rad) from a TCP to a pose, into an array of shape (6,)."""
    for i in range(3):
        error[i] = target_m[i] - at_m[i]
    trace, x, y, z = 0.0, 0.0, 0.0, 0.0
    for k in range(3):  # relative = target @ tcp.T
        trace += target[0, k] * tcp[0, k] + target[1, k] * tcp[1, k] + target[2, k] * tcp[2, k]
        x += target[2, k] * tcp[1, k] - target[1, k] * tcp[2, k]
        y += target[0, k] * tcp[2, k] - target[2, k] * tcp[0, k]
        z += target[1, k] * tcp[0, k] - target[0, k] * tcp[1, k]
    double_sine = math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(double_sine, trace - 1.0)
    if double_sine <= AXIS_LOST and angle > HALF_TURN:  # the axis is lost: push off it
        error[3], error[4], error[5] = 0.5, 0.5, 0.5
        return
    scale = angle / double_sine if double_sine > TINY else 0.5
    error[3], error[4], error[5] = x * scale, y * scale, z * scale


@compiled("void(f8[:,::1], f8[::1], f8, f8, f8[:,::1], f8[::1])")
def step_along(
    rows: Array, error: Array, damping: float, largest_rad: float, factor: Array, step: Array
) -> None:
    """Damped least squares step: rows.T (rows rows.T + damping^2)^-1 error, by Cholesky.

    Args:
        rows: Jacobian. Shape (6, J).
        error: Shape (6,).
        damping: Of the least squares, 1.
        largest_rad: No joint moves more; the whole step is shortened.
        factor: Room for the factor. Shape (6, 6).
        step: Written, rad. Shape (J,).
    """
    joints = rows.shape[1]
    for i in range(POSE):
        for j in range(i + 1):
            total = damping * damping if i == j else 0.0
            for k in range(joints):
                total += rows[i, k] * rows[j, k]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(total) if i == j else total / factor[j, j]
    solution = np.empty(POSE)
    for i in range(POSE):
        total = error[i]
        for k in range(i):
            total -= factor[i, k] * solution[k]
        solution[i] = total / factor[i, i]
    for i in range(POSE - 1, -1, -1):
        total = solution[i]
        for k in range(i + 1, POSE):
            total -= factor[k, i] * solution[k]
        solution[i] = total / factor[i, i]
    largest = 0.0
    for joint in range(joints):
        total = 0.0
        for i in range(POSE):
            total += rows[i, joint] * solution[i]
        step[joint] = total
        largest = max(largest, abs(total))
    if largest > largest_rad:
        for joint in range(joints):
            step[joint] *= largest_rad / largest


@compiled("void(f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1], f8[:,::1], i8, f8[::1], f8[:,::1])")
def solve_all(
    turns: Array,
    offsets: Array,
    target_m: Array,
    target: Array,
    q: Array,
    iterations: int,
    figures: Array,
    left: Array,
) -> None:
    """Inverse kinematics of N poses, each alone.

    Args:
        turns: As of `place`.
        offsets: As of `place`.
        target_m: Positions, m. Shape (N, 3).
        target: Rotations. Shape (N, 3, 3).
        q: Seeds; the last iterates are written over them, rad. Shape (N, J).
        iterations: Most steps.
        figures: Damping, largest step, rad, tolerated position, m, and rotation, rad. Shape (4,).
        left: Written: distance, m, and angle, rad, that are left; NaN, and the seed is kept, where
            an input is not finite. Shape (N, 2).
    """
    joints = q.shape[1]
    rotation, position = np.empty((joints + 1, 3, 3)), np.empty((joints + 1, 3))
    rows, factor = np.empty((POSE, joints)), np.empty((POSE, POSE))
    error, step = np.empty(POSE), np.empty(joints)
    for n in range(len(q)):
        left[n, 0] = left[n, 1] = np.nan
        total = q[n].sum() + target_m[n].sum() + target[n].sum()
        if not math.isfinite(total):
            continue
        for iteration in range(iterations + 1):
            place(turns, offsets, q[n], rotation, position)
            pose_error(rotation[joints], position[joints], target_m[n], target[n], error)
            a = error[0] * error[0] + error[1] * error[1] + error[2] * error[2]
            b = error[3] * error[3] + error[4] * error[4] + error[5] * error[5]
            left[n, 0], left[n, 1] = math.sqrt(a), math.sqrt(b)
            near = left[n, 0] <= figures[2] and left[n, 1] <= figures[3]
            if near or iteration == iterations:
                break
            jacobian(rotation, position, rows)
            step_along(rows, error, figures[0], figures[1], factor, step)
            for joint in range(joints):
                q[n, joint] += step[joint]
