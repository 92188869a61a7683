"""Task-space impedance controller: the contact controller below every policy.

tau = J^T (K e + D (v_des - J dq)) + N (k_0 (q_0 - q) - d_0 dq) + h(q, dq)

with the pose error e, gravity and Coriolis torques h from the model, and N = I - J^T (J J^T)^-1 J
the static null space of the task. Stiffness, damping and limits are fixtures of the ladder: a
change of this file changes what every gate measured.

Source: Hogan 1985 (impedance control); Khatib 1987 (operational space); the law is the one of
libfranka's Cartesian impedance example, stiffness below the 3000 N/m that its maker allows.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STIFFNESS_N_M = 2500.0
STIFFNESS_NM_RAD = 120.0
# Damping ratio 0.8 to 1.4 (translation) for the effective TCP masses of 4 to 11 kg of this arm,
# 0.7 to 2 (rotation) for its 0.1 to 0.8 kg m2, both (J M^-1 J^T)^-1.
DAMPING_N_S_M = 280.0
DAMPING_NM_S_RAD = 14.0
POSTURE_STIFFNESS_NM_RAD = 10.0
POSTURE_DAMPING_NM_S_RAD = 4.0
# Saturation of the error: a far target pulls with at most 150 N and 60 N m per axis.
MAXIMUM_ERROR_M = 0.06
MAXIMUM_ERROR_RAD = 0.5
# Control steps between two updates of the null space projector (10 ms at 500 Hz).
PROJECTOR_PERIOD_STEPS = 5


class ImpedanceController:
    """Torques that make the TCP follow a moving pose like a damped spring.

    Bound to one `MjData`: it reads the kinematics that `mj_step1` has just computed and writes
    `ctrl`, without allocating.

    Args:
        model: Arm joints are its first degrees of freedom, and drive its first actuators.
        data: State; must live as long as the controller.
        site: Name of the TCP site.
        posture_rad: Where the null space pulls the arm to, one angle per joint of the arm.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        *,
        site: str,
        posture_rad: Sequence[float],
    ) -> None:
        joints = len(posture_rad)
        self._model, self._data = model, data
        self._site = int(model.site(site).id)
        self._position = data.site_xpos[self._site]
        self._rotation_t = data.site_xmat[self._site].reshape(3, 3).T
        self._q = data.qpos[:joints]
        self._dq = data.qvel[:joints]
        self._bias = data.qfrc_bias[:joints]
        self._passive = data.qfrc_passive[:joints]
        self._ctrl = data.ctrl[:joints]
        self._jacobian_full = np.zeros((6, model.nv))
        self._jac_position = self._jacobian_full[:3]
        self._jac_rotation = self._jacobian_full[3:]
        self._jacobian = self._jacobian_full[:, :joints]
        self._stiffness = np.repeat([STIFFNESS_N_M, STIFFNESS_NM_RAD], 3)
        self._damping = np.repeat([DAMPING_N_S_M, DAMPING_NM_S_RAD], 3)
        self._error_limit = np.repeat([MAXIMUM_ERROR_M, MAXIMUM_ERROR_RAD], 3)
        self._posture = np.array(posture_rad)
        self._torque_limit = np.abs(model.actuator_ctrlrange[:joints]).max(axis=1)
        self._error = np.zeros(6)
        self._wrench = np.zeros(6)
        self._torque = np.zeros(joints)
        self._posture_torque = np.zeros(joints)
        self._scratch = np.zeros(joints)
        self._relative = np.zeros((3, 3))
        self._relative_flat = self._relative.reshape(9)
        self._projector = np.zeros((joints, joints))
        self._identity = np.eye(joints)
        self._steps = 0

    def reset(self) -> None:
        """Forget the null space projector's age, so that equal states give equal torques."""
        self._steps = 0

    def step(self, position_m: Array, rotation: Array, velocity: Array) -> None:
        """Write the torques of one control step to `ctrl`.

        Call it between `mj_step1` and `mj_step2`.

        Args:
            position_m: Desired TCP position, m. Shape (3,).
            rotation: Desired TCP rotation. Shape (3, 3).
            velocity: Desired TCP velocity, m/s, and angular velocity, rad/s. Shape (6,).
        """
        mujoco.mj_jacSite(
            self._model, self._data, self._jac_position, self._jac_rotation, self._site
        )
        jacobian, error, wrench = self._jacobian, self._error, self._wrench
        np.subtract(position_m, self._position, out=error[:3])
        np.dot(rotation, self._rotation_t, out=self._relative)
        r = self._relative_flat.tolist()
        error[3] = 0.5 * (r[7] - r[5])
        error[4] = 0.5 * (r[2] - r[6])
        error[5] = 0.5 * (r[3] - r[1])
        np.minimum(error, self._error_limit, out=error)
        np.maximum(error, -self._error_limit, out=error)
        np.dot(jacobian, self._dq, out=wrench)
        np.subtract(velocity, wrench, out=wrench)
        wrench *= self._damping
        error *= self._stiffness
        wrench += error
        if self._steps % PROJECTOR_PERIOD_STEPS == 0:
            self._update_projector()
        self._steps += 1
        torque, posture, scratch = self._torque, self._posture_torque, self._scratch
        np.subtract(self._posture, self._q, out=posture)
        posture *= POSTURE_STIFFNESS_NM_RAD
        np.multiply(self._dq, POSTURE_DAMPING_NM_S_RAD, out=scratch)
        posture -= scratch
        np.dot(self._projector, posture, out=torque)
        torque += self._bias
        torque -= self._passive
        np.dot(wrench, jacobian, out=scratch)
        torque += scratch
        np.minimum(torque, self._torque_limit, out=torque)
        np.maximum(torque, -self._torque_limit, out=self._ctrl)

    def _update_projector(self) -> None:
        jacobian = self._jacobian
        gram = jacobian @ jacobian.T
        gram.flat[::7] += 1e-9
        np.dot(jacobian.T, np.linalg.solve(gram, jacobian), out=self._projector)
        np.subtract(self._identity, self._projector, out=self._projector)
