"""Motions of the operator: at rest at both ends, within their speed."""

import numpy as np

from genpolicy.tasks.tabletop_insertion.plans import travel


def test_travel_starts_and_ends_at_rest_and_keeps_its_speed():
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.1, 0.0], [0.3, 0.0, 0.1]])
    path = travel(points, speed_m_s=0.3, acceleration_m_s2=1.2)
    np.testing.assert_allclose(path[-1], points[-1], atol=1e-9)
    speed = np.linalg.norm(np.diff(np.vstack([points[:1], path]), axis=0), axis=1) / 0.05
    assert speed.max() <= 0.3 * 1.001
    assert speed[0] < 0.05 and speed[-1] < 0.05
    np.testing.assert_array_equal(
        travel(points[:1].repeat(2, axis=0), speed_m_s=1, acceleration_m_s2=1), points[:1]
    )
