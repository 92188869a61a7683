"""The default task's scene, its kinematics and its collision model."""

import sys
from pathlib import Path

import numpy as np
import pytest

import genpolicy.tasks.tabletop_insertion as task_package
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.scene_state import SceneState

sys.path.insert(0, str(Path(__file__).parent))

SCENE = Path(task_package.__file__).with_name("scene.xml")
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="session")
def scene_path():
    return SCENE


@pytest.fixture(scope="session")
def arm():
    return ArmKinematics(SCENE)


@pytest.fixture(scope="session")
def model(arm):
    return CollisionModel(SCENE, arm)


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def random_scene():
    def draw(rng):
        half = rng.uniform(-0.3, 0.3) / 2
        return SceneState(
            {
                "post": ((0.5, rng.uniform(-0.2, 0.2), 0.11), UPRIGHT),
                "fixture": (
                    (rng.uniform(0.4, 0.7), rng.uniform(-0.2, 0.2), 0.0),
                    (np.cos(half), 0.0, 0.0, np.sin(half)),
                ),
            }
        )

    return draw
