"""Depth of what is held in the target, against a depth that is known; nothing where nothing is."""

import numpy as np
import pytest

from genpolicy.errors import NonFiniteError
from genpolicy.robot.collision import CollisionModel, Paths
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.pressing import pressed_depth_m
from genpolicy.robot.scene_state import SceneState
from genpolicy.tasks.api import load_task

DOWN = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def model():
    scene = load_task("tabletop_insertion").scene_path
    return CollisionModel(scene, ArmKinematics(scene))


def paths(model, place, *, held=True):
    home = np.array([[0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785]])
    found = model.kinematics.solve_with_restarts(np.array([place]), DOWN[None], q_seed_rad=home)
    assert found.converged[0]
    return Paths(
        q_rad=np.stack([found.q_rad, found.q_rad], axis=1), opening_m=np.zeros((1, 2)),
        held=np.full((1, 2), held), scenes=(SceneState(),), contact_allowed=np.array([True]),
        clearance_m=np.zeros(1),
    )  # fmt: skip


@pytest.mark.parametrize(("place", "depth_m"), [
    ((0.677, 0.0, 0.097), 0.018), ((0.677, 0.0, 0.110), 0.005), ((0.677, 0.0, 0.12), 0.0),
    ((0.65, 0.0, 0.083), 0.0),
])  # fmt: skip
def test_a_depth_that_is_known(model, place, depth_m):
    """The tip is 55 mm below the TCP, the top of the target's walls 60 mm above the table."""
    found = pressed_depth_m(model, paths(model, place))
    np.testing.assert_allclose(found, [depth_m], atol=1e-5)


def test_an_empty_hand_presses_nothing_and_a_number_that_is_none_is_refused(model):
    place = (0.677, 0.0, 0.097)
    assert pressed_depth_m(model, paths(model, place, held=False)) == 0.0
    bad = paths(model, place)
    bad.q_rad[0, 1, 0] = np.nan
    with pytest.raises(NonFiniteError):
        pressed_depth_m(model, bad)
