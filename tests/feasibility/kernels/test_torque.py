"""Inverse dynamics against Pinocchio's own recursion."""

import numpy as np
import pinocchio as pin

from genpolicy.feasibility.kernels.torque import cross


def test_torques_are_those_of_pinocchio(cell):
    arm, rng = cell.kinematics, np.random.default_rng(0)
    joints, data = cell.joint_count, arm.model.createData()
    q = rng.uniform(arm.lower_rad, arm.upper_rad, (20, joints))
    dq, ddq = rng.normal(0, 2, (2, 20, joints))
    found = cell.dynamics.torque(q, dq, ddq)
    for row in range(20):
        whole = [np.concatenate([v, np.zeros(arm.model.nv - joints)]) for v in (dq[row], ddq[row])]
        at = pin.neutral(arm.model)
        at[:joints] = q[row]
        # Pinocchio counts the joints' own inertia, not their damping.
        expected = pin.rnea(arm.model, data, at, *whole)[:joints]
        expected = expected + arm.model.damping[:joints] * dq[row]
        assert np.allclose(found[row], expected, atol=1e-9)


def test_a_cross_product():
    first, second = np.random.default_rng(1).normal(0, 1, (2, 3))
    assert np.allclose(cross(tuple(first), tuple(second)), np.cross(first, second), atol=1e-15)
