"""Configurations near contact, and paths through them."""

import numpy as np

from genpolicy.robot.collision import Paths

DOWN = np.diag([1.0, -1.0, -1.0])


HOME = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785])


def solve(arm, positions, seed=HOME):
    positions = np.asarray(positions, float)
    result = arm.solve(
        positions,
        np.tile(DOWN, (len(positions), 1, 1)),
        q_seed_rad=np.tile(seed, (len(positions), 1)),
    )
    assert result.converged.all()
    return result.q_rad


def paths_of(q, scene, *, held=True, opening=0.0, allowed=False, clearance=0.0):
    batch, points = q.shape[:2]
    return Paths(
        q, np.full((batch, points), opening), np.full((batch, points), held), (scene,) * batch,
        np.full(batch, allowed), np.full(batch, clearance),
    )  # fmt: skip
