"""Inverse dynamics of one configuration after the other (`robot.dynamics`)."""

import numpy as np
from numpy.typing import NDArray

from genpolicy.compiled import compiled
from genpolicy.feasibility.kernels.arm import place

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

THREE = "UniTuple(f8, 3)"


@compiled(f"{THREE}({THREE}, {THREE})")
def cross(first: Vector, second: Vector) -> Vector:
    """Cross product."""
    a, b, c = first
    x, y, z = second
    return b * z - c * y, c * x - a * z, a * y - b * x


@compiled(f"{THREE}({THREE}, {THREE})")
def plus(first: Vector, second: Vector) -> Vector:
    """Sum."""
    return first[0] + second[0], first[1] + second[1], first[2] + second[2]


@compiled(f"{THREE}({THREE}, {THREE}, {THREE})")
def accelerated(turning: Vector, bending: Vector, lever: Vector) -> Vector:
    """Acceleration of a lever's end against its begin."""
    return plus(cross(bending, lever), cross(turning, cross(turning, lever)))


@compiled(f"{THREE}(f8[:,:,::1], i8, {THREE})")
def outwards(rotations: Array, joint: int, vector: Vector) -> Vector:
    """A vector of one frame in axes of the base."""
    x, y, z = vector
    return (
        rotations[joint, 0, 0] * x + rotations[joint, 0, 1] * y + rotations[joint, 0, 2] * z,
        rotations[joint, 1, 0] * x + rotations[joint, 1, 1] * y + rotations[joint, 1, 2] * z,
        rotations[joint, 2, 0] * x + rotations[joint, 2, 1] * y + rotations[joint, 2, 2] * z,
    )


@compiled(f"{THREE}(f8[:,:,::1], f8[:,:,::1], i8, {THREE})")
def weighed(rotations: Array, inertia: Array, joint: int, vector: Vector) -> Vector:
    """Inertia of a link times a vector, both in axes of the base."""
    x, y, z = vector
    a = rotations[joint, 0, 0] * x + rotations[joint, 1, 0] * y + rotations[joint, 2, 0] * z
    b = rotations[joint, 0, 1] * x + rotations[joint, 1, 1] * y + rotations[joint, 2, 1] * z
    c = rotations[joint, 0, 2] * x + rotations[joint, 1, 2] * y + rotations[joint, 2, 2] * z
    return outwards(rotations, joint, outwards(inertia, joint, (a, b, c)))


@compiled("void(f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,:], f8[::1])")
def gather(
    rotation: Array,
    position: Array,
    forces: Array,
    moments: Array,
    other: Array,
    motion: Array,
    result: Array,
) -> None:
    """Torques of the joints, N m, of the forces on each link and behind it, from the tip back."""
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for joint in range(len(result) - 1, -1, -1):
        force = plus(force, (forces[joint, 0], forces[joint, 1], forces[joint, 2]))
        moment = plus(moment, (moments[joint, 0], moments[joint, 1], moments[joint, 2]))
        at = (position[joint, 0], position[joint, 1], position[joint, 2])
        a, b, c = cross(at, force)
        total = rotation[joint, 0, 2] * (moment[0] - a) + rotation[joint, 1, 2] * (moment[1] - b)
        total += rotation[joint, 2, 2] * (moment[2] - c)
        total += other[joint, 0] * motion[2, joint] + other[joint, 1] * motion[1, joint]
        result[joint] = total


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
        other: Armature, kg m^2, and damping, N m s/rad, of each joint, then gravity, m/s^2, in the
            last row. Shape (J + 1, 3).
        result: Written. Shape (N, J).

    Source:
        Newton and Euler (Luh, Walker and Paul 1980), in axes of the base frame.
    """
    joints = len(mass)
    rotation, position = np.empty((joints + 1, 3, 3)), np.empty((joints + 1, 3))
    forces, moments = np.empty((joints, 3)), np.empty((joints, 3))
    for n in range(motion.shape[1]):
        place(turns, offsets, motion[0, n], rotation, position)
        turning, bending = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        carried = (-other[joints, 0], -other[joints, 1], -other[joints, 2])
        before = (position[0, 0], position[0, 1], position[0, 2])
        for joint in range(joints):
            at = (position[joint, 0], position[joint, 1], position[joint, 2])
            way = (at[0] - before[0], at[1] - before[1], at[2] - before[2])
            carried, before = plus(carried, accelerated(turning, bending, way)), at
            speed, push = motion[1, n, joint], motion[2, n, joint]
            spin = outwards(rotation, joint, (0.0, 0.0, speed))
            bending = plus(bending, plus(cross(turning, spin),
                                         outwards(rotation, joint, (0.0, 0.0, push))))  # fmt: skip
            turning = plus(turning, spin)
            centre = (lever[joint, 0], lever[joint, 1], lever[joint, 2])
            reach = outwards(rotation, joint, centre)
            x, y, z = plus(carried, accelerated(turning, bending, reach))
            force = (x * mass[joint], y * mass[joint], z * mass[joint])
            moment = plus(weighed(rotation, inertia, joint, bending),
                          cross(turning, weighed(rotation, inertia, joint, turning)))  # fmt: skip
            moment = plus(moment, cross(plus(at, reach), force))
            forces[joint, 0], forces[joint, 1], forces[joint, 2] = force
            moments[joint, 0], moments[joint, 1], moments[joint, 2] = moment
        gather(rotation, position, forces, moments, other, motion[:, n], result[n])
