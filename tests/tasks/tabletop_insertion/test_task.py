"""The default task answers what the library asks: poses, phases, sides, plans of its own start."""

import numpy as np
import pytest

from genpolicy.contract.action import GRIPPER, POSITION
from genpolicy.errors import ContractError
from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.observation import OBSERVATION
from genpolicy.tasks.tabletop_insertion.task import TASK, UNASSIGNED

PHASES = TASK.phases


@pytest.fixture(scope="module")
def world():
    start = TASK.sample_start(stream(1, "task"))
    return TASK.make_world(start, settings=WorldSettings(TASK.calibration_epochs[0]))


def observation(**channels):
    row = np.zeros(OBSERVATION.dim)
    for name, values in channels.items():
        row[OBSERVATION.slices[name]] = values
    return row


def path(side, *, x=(0.38, 0.65), widest_m=0.1):
    along = np.linspace(*x, 40)
    bow = side * widest_m * np.sin(np.linspace(0, np.pi, 40))
    return np.stack([along, bow, np.full(40, 0.15)], axis=1)


def test_the_side_is_told_from_the_post_and_mirrored_with_the_path():
    seen = observation(post_position_m=[0.02])
    left, right = (TASK.mode_of(path(side) + np.array([0, 0.02, 0]), seen) for side in (1, -1))
    assert {left, right} == {"left", "right"} and left == "left"


def test_a_path_that_passes_closely_or_begins_beyond_the_post_has_no_side():
    seen = observation(post_position_m=[0.0])
    assert TASK.mode_of(path(1, widest_m=0.029), seen) == UNASSIGNED
    assert TASK.mode_of(path(1, widest_m=0.031), seen) == "left"
    assert TASK.mode_of(path(1, x=(scene.POST_X_M, 0.65)), seen) == UNASSIGNED
    assert TASK.mode_of(path(np.nan), seen) == UNASSIGNED


@pytest.mark.parametrize("number", range(len(PHASES)))
def test_a_phase_is_read_from_its_one_hot_channel(number):
    assert TASK.phase_of(observation(phase=np.eye(len(PHASES))[number])) == PHASES[number]


def test_the_action_that_keeps_still_is_the_observed_pose(world):
    seen = world.observe()
    action = TASK.action_at(seen)
    np.testing.assert_array_equal(action[POSITION], seen[OBSERVATION.slices["tcp_position_m"]])
    assert action[GRIPPER] == seen[OBSERVATION.slices["gripper_opening_m"]][0]
    assert action.shape == (10,)


def test_bodies_stand_where_the_observation_puts_them():
    yaw = 0.4
    seen = observation(hole_pose=[0.6, -0.05, np.cos(yaw), np.sin(yaw)], post_position_m=[0.03])
    poses = TASK.scene_poses(seen)
    assert set(TASK.obstacles) < set(poses)
    assert poses[scene.POST][0][1] == pytest.approx(0.03)
    (fixture,) = set(poses) - set(TASK.obstacles)
    at, turn = poses[fixture]
    np.testing.assert_allclose(at[:2], [0.6, -0.05])
    assert 2 * np.arctan2(turn[3], turn[0]) == pytest.approx(yaw)


def test_a_fallback_begins_at_the_last_command(world):
    plan = TASK.fallback(world, "retreat")
    assert plan.shape[1] == 10
    assert np.linalg.norm(plan[0, POSITION] - world.last_action[POSITION]) < 0.01


def test_a_start_of_another_task_is_refused():
    with pytest.raises(ContractError, match="expected InsertionStart"):
        TASK.make_world(object(), settings=WorldSettings("epoch_1"))
    with pytest.raises(ContractError, match="expected InsertionStart"):
        TASK.replay(object(), np.zeros((1, 10)))
