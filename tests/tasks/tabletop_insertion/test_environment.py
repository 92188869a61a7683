"""The Gymnasium environment: its interface, seeds, and refusals."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from genpolicy.tasks.tabletop_insertion.environment import ENVIRONMENT_ID


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
