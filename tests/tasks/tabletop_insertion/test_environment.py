import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion.environment import ENVIRONMENT_ID
from genpolicy.tasks.tabletop_insertion.picture import draw
from genpolicy.tasks.tabletop_insertion.start import sample_start
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld


def test_gymnasium_accepts_the_environment():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check_env(gymnasium.make(ENVIRONMENT_ID, render_mode="rgb_array").unwrapped)


def test_same_seed_same_episode_other_seed_another():
    env = gymnasium.make(ENVIRONMENT_ID).unwrapped
    first, info = env.reset(seed=4)
    again, info_again = env.reset(seed=4)
    other, _ = env.reset(seed=5)
    assert info == info_again
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_rotation_that_is_none_keeps_the_last():
    env = gymnasium.make(ENVIRONMENT_ID).unwrapped
    observation, _ = env.reset(seed=4)
    action = np.concatenate([observation[:3], np.zeros(6), [0.01]])
    after, reward, terminated, truncated, info = env.step(action)
    np.testing.assert_allclose(after[3:9], observation[3:9], atol=1e-3)
    assert (reward, terminated, truncated) == (0.0, False, False)
    assert info["phase"] == "approach"


def test_stepping_before_reset_is_refused():
    env = gymnasium.make(ENVIRONMENT_ID).unwrapped
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(env.action_space.sample())


def test_the_picture_shows_the_scene_and_is_the_same_twice():
    world = TabletopWorld(sample_start(stream(1, "picture")), settings=WorldSettings("epoch_1"))
    first = draw(world.model, world.data, width=120, height=90)
    assert first.shape == (90, 120, 3) and first.dtype == np.uint8
    np.testing.assert_array_equal(first, draw(world.model, world.data, width=120, height=90))
    red, _, blue = first.astype(int).reshape(-1, 3).T
    assert ((blue > red + 40) & (blue > 60)).sum() > 50  # the post
    assert ((red > 2 * blue) & (red > 80)).sum() > 10  # the peg
