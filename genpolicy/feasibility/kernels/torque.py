"""Inverse dynamics of one configuration after the other (`robot.dynamics`)."""

import numpy as np
from numpy.typing import NDArray

from genpolicy.feasibility.kernels.arm import place
from genpolicy.feasibility.kernels.compiled import compiled

Array = NDArray[np.float64]


@compiled("void(f8[::1], f8[::1], f8[::1])")
def cross_add(first: Array, second: Array, result: Array) -> None:
    """Add a cross product to an array of shape (3,)."""
    result[0] += first[1] * second[2] - first[2] * second[1]
    result[1] += first[2] * second[0] - first[0] * second[2]
    result[2] += first[0] * second[1] - first[1] * second[0]


@compiled("void(f8[::1], f8[::1], f8[::1], f8[::1], f8[::1])")
def accelerate(turning: Array, bending: Array, lever: Array, room: Array, result: Array) -> None:
    """Add the acceleration of a lever's end against its begin to an array of shape (3,)."""
    cross_add(bending, lever, result)
    room[:] = 0.0
    cross_add(turning, lever, room)
    cross_add(turning, room, result)


@compiled("void(f8[:,::1], f8[:,::1], f8[::1], f8[::1])")
def turned(rotation: Array, inertia: Array, vector: Array, result: Array) -> None:
    """Rotation @ inertia @ rotation.T @ vector, into an array of shape (3,)."""
    inner = np.zeros(3)
    for i in range(3):
        for k in range(3):
            local = rotation[0, k] * vector[0] + rotation[1, k] * vector[1]
            inner[i] += inertia[i, k] * (local + rotation[2, k] * vector[2])
    for i in range(3):
        result[i] = 0.0
        for k in range(3):
            result[i] += rotation[i, k] * inner[k]


@compiled(
    "void(f8[:,:,::1], f8[:,::1], f8[:,:,::1], f8[::1], f8[:,::1], f8[:,:,::1], f8[:,::1],"
    " f8[:,::1])"
)
def torques(
    turns: Array,
    offsets: Array,
    motion: Array,
    mass: Array,
    lever: Array,
    inertia: Array,
    other: Array,
    result: Array,
) -> None:
    """Torques of the joints that make the arm move like this, N m.

    Args:
        turns: As of `arm.place`.
        offsets: As of `arm.place`.
        motion: Positions, velocities, accelerations, rad, s. Shape (3, N, J).
        mass: Of each link, kg. Shape (J,).
        lever: Centre of mass of each, m. Shape (J, 3).
        inertia: About that centre, kg m^2. Shape (J, 3, 3).
        other: Armature, kg m^2, damping, N m s/rad, of each joint, in columns 0 and 1; gravity,
            m/s^2, in column 2 of the first three. Shape (J, 3), J >= 3.
        result: Written. Shape (N, J).

    Source:
        Newton and Euler (Luh, Walker and Paul 1980), in axes of the base frame.
    """
    joints = len(mass)
    rotation, position = np.empty((joints + 1, 3, 3)), np.empty((joints + 1, 3))
    force, moment = np.empty((joints, 3)), np.empty((joints, 3))
    turning, bending, carried = np.empty(3), np.empty(3), np.empty(3)
    axis, spin, room = np.empty(3), np.empty(3), np.empty(3)
    reach, way = np.empty(3), np.empty(3)
    for n in range(motion.shape[1]):
        place(turns, offsets, motion[0, n], rotation, position)
        turning[:], bending[:] = 0.0, 0.0
        for i in range(3):
            carried[i] = -other[i, 2]
        for joint in range(joints):
            if joint:
                for i in range(3):
                    way[i] = position[joint, i] - position[joint - 1, i]
                accelerate(turning, bending, way, room, carried)
            for i in range(3):
                axis[i] = rotation[joint, i, 2]
                spin[i] = axis[i] * motion[1, n, joint]
                bending[i] += axis[i] * motion[2, n, joint]
            cross_add(turning, spin, bending)
            for i in range(3):
                turning[i] += spin[i]
                reach[i] = 0.0
                for k in range(3):
                    reach[i] += rotation[joint, i, k] * lever[joint, k]
                force[joint, i] = carried[i]
            accelerate(turning, bending, reach, room, force[joint])
            turned(rotation[joint], inertia[joint], bending, moment[joint])
            turned(rotation[joint], inertia[joint], turning, room)
            cross_add(turning, room, moment[joint])
            for i in range(3):
                force[joint, i] *= mass[joint]
                way[i] = position[joint, i] + reach[i]
            cross_add(way, force[joint], moment[joint])
        for joint in range(joints - 1, -1, -1):
            if joint < joints - 1:
                for i in range(3):
                    force[joint, i] += force[joint + 1, i]
                    moment[joint, i] += moment[joint + 1, i]
            room[:] = 0.0
            cross_add(position[joint], force[joint], room)
            total = other[joint, 0] * motion[2, n, joint] + other[joint, 1] * motion[1, n, joint]
            for i in range(3):
                total += rotation[joint, i, 2] * (moment[joint, i] - room[i])
            result[n, joint] = total
