"""The observation holds what its contract names."""

import numpy as np
import pytest

from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion.observation import OBSERVATION
from genpolicy.tasks.tabletop_insertion.start import sample_start
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld

SETTINGS = WorldSettings("epoch_1")


@pytest.fixture
def start():
    return sample_start(stream(2, "world"))


def test_observation_holds_what_the_contract_names(start):
    world = TabletopWorld(start, settings=SETTINGS)
    observation = world.observe()
    assert observation.shape == (OBSERVATION.dim,)
    np.testing.assert_array_equal(observation[:3], world.tcp_pose[0])
    assert observation[OBSERVATION.slices["phase"]].tolist() == [1, 0, 0, 0, 0, 0]
    hole = observation[OBSERVATION.slices["hole_pose"]]
    assert np.hypot(hole[0] - start.hole_x_m, hole[1] - start.hole_y_m) < 0.002
