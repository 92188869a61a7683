"""Torques that a motion of the arm needs: inverse dynamics of whole batches.

Masses and inertias are those of the scene file, as Pinocchio reads them. The recursion is written
out for many configurations at once (one call of the library per configuration costs more than the
arithmetic); a test holds it, Pinocchio and MuJoCo together.
"""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.payload import Payload

Array = NDArray[np.float64]


class ArmDynamics:
    """Rigid body dynamics of an arm and of what hangs at it, with fingers closed.

    Args:
        kinematics: The arm.
        payload: What the hand holds, which is no part of the arm's tree; None: nothing.
    """

    def __init__(self, kinematics: ArmKinematics, payload: Payload | None = None) -> None:
        self.kinematics = kinematics
        model, joints = kinematics.model, kinematics.joint_count
        bodies = _lumped(model, joints)
        if payload is not None:
            load = pin.Inertia(payload.mass_kg, payload.centre_m, payload.inertia_kg_m2)
            bodies[payload.joint] += load
        self._mass = np.array([body.mass for body in bodies])
        self._centre = np.array([body.lever for body in bodies])
        self._inertia = np.array([body.inertia for body in bodies])
        self._armature = np.array(model.armature[:joints], dtype=float)
        self._damping = np.array(model.damping[:joints], dtype=float)
        self._gravity = np.array(model.gravity.linear, dtype=float)

    def torque(self, q_rad: Array, dq_rad_s: Array, ddq_rad_s2: Array) -> Array:
        """Torques of the joints that make the arm move like this, N m.

        Args:
            q_rad: Joint positions, rad. Shape (N, J).
            dq_rad_s: Joint velocities, rad/s. Shape (N, J).
            ddq_rad_s2: Joint accelerations, rad/s^2. Shape (N, J).

        Returns:
            Shape (N, J).

        Source:
            Newton and Euler (Luh, Walker and Paul 1980), in axes of the base frame, where the
            recursions are sums along the chain; the joints' own inertia and damping added.
        """
        frames = self.kinematics.frames(q_rad)
        rotation, origin = frames.rotation[:, :-1], frames.position_m[:, :-1]
        axis = rotation[..., 2]
        spin = axis * dq_rad_s[..., None]
        turning = np.cumsum(spin, axis=1)
        bent = _cross(turning - spin, spin) + axis * ddq_rad_s2[..., None]
        bending = np.cumsum(bent, axis=1)
        # The base accelerates upwards instead of everything being pulled down.
        lever = np.diff(origin, axis=1)
        pulled = _accelerated(turning[:, :-1], bending[:, :-1], lever)
        base = np.broadcast_to(-self._gravity, (len(origin), 1, 3))
        carried = np.cumsum(np.concatenate([base, pulled], axis=1), axis=1)
        reach = (rotation @ self._centre[:, :, None])[..., 0]
        force = (carried + _accelerated(turning, bending, reach)) * self._mass[:, None]
        inertia = rotation @ self._inertia @ rotation.swapaxes(-1, -2)
        momentum = (inertia @ turning[..., None])[..., 0]
        moment = (inertia @ bending[..., None])[..., 0] + _cross(turning, momentum)
        moment += _cross(origin + reach, force)
        forces, moments = _from_the_tip(force), _from_the_tip(moment)
        torque: Array = np.sum(axis * (moments - _cross(origin, forces)), axis=-1)
        torque += self._armature * ddq_rad_s2 + self._damping * dq_rad_s
        return torque


def _lumped(model: pin.Model, joints: int) -> list[pin.Inertia]:
    """Inertia of each link in its joint's frame, with what hangs behind it and is no arm."""
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    bodies = [pin.Inertia(model.inertias[i + 1]) for i in range(joints)]
    for joint in range(joints + 1, model.njoints):
        link = joint
        while link > joints:
            link = int(model.parents[link])
        if link > 0:
            placed = data.oMi[link].actInv(data.oMi[joint])
            bodies[link - 1] += placed.act(model.inertias[joint])
    return bodies


def _accelerated(turning: Array, bending: Array, lever: Array) -> Array:
    """Acceleration of a lever's end against its begin. Shapes (..., 3)."""
    return _cross(bending, lever) + _cross(turning, _cross(turning, lever))


def _from_the_tip(values: Array) -> Array:
    """Sum over each link and all behind it. Shape (N, J, 3)."""
    total: Array = np.cumsum(values[:, ::-1], axis=1)[:, ::-1]
    return total


def _cross(first: Array, second: Array) -> Array:
    """Cross product along the last axis; numpy's own spends most of its time on other shapes."""
    result = np.empty(np.broadcast_shapes(first.shape, second.shape))
    a, b, c = first[..., 0], first[..., 1], first[..., 2]
    x, y, z = second[..., 0], second[..., 1], second[..., 2]
    result[..., 0] = b * z - c * y
    result[..., 1] = c * x - a * z
    result[..., 2] = a * y - b * x
    return result
