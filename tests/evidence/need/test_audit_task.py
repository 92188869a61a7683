"""What the audit gets from the task: replay of an episode, round obstacles."""

import json

import numpy as np
import pytest

from genpolicy.evidence.need.audit_task import replay_episode, round_obstacles
from genpolicy.tasks.tabletop_insertion import scene


def test_a_recorded_success_replays_as_one(task, data):
    uuid = data.episodes["episode_uuid"].iloc[0]
    assert replay_episode(task, data, uuid) == "success"


def test_another_start_does_not(task, data):
    """The label must follow from start and actions, not from the recording."""
    episodes = data.episodes.copy()
    start = json.loads(episodes["scene_start"].iloc[0])
    moved = json.dumps(start | {"hole_y_m": start["hole_y_m"] + 0.02})
    episodes.loc[episodes.index[0], "scene_start"] = moved
    other = type(data)(**{**vars(data), "episodes": episodes})
    assert replay_episode(task, other, episodes["episode_uuid"].iloc[0]) == "failure"


def test_an_unknown_episode_is_an_error(task, data):
    with pytest.raises(ValueError, match="nobody"):
        replay_episode(task, data, "nobody")


def test_the_post_is_the_one_round_obstacle(task):
    (post,) = round_obstacles(task)
    # Scene file: cylinder of 25 mm radius at x = 0.50 m.
    assert post.radius_m == pytest.approx(0.025)
    np.testing.assert_allclose([post.x_m, post.y_m], [scene.POST_X_M, 0.0])
