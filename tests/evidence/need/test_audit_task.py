"""What the audit gets from task and ladder: horizons, channels, replay, round obstacles."""

import json

import numpy as np
import pytest

from genpolicy.audit.settings import AuditSettings
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import ConfigError
from genpolicy.evidence.need.audit_task import replay_episode, round_obstacles, settings_of
from genpolicy.tasks.tabletop_insertion import scene

HORIZONS = HorizonConfig(
    observation_horizon=3, prediction_horizon=12, execution_horizon=6, action_period_s=0.05
)


def test_the_chunks_audited_are_those_that_train(task):
    settings = settings_of(AuditSettings(), task, HORIZONS, confidence=0.9)
    found = settings.observation_horizon, settings.chunk_rows, settings.persistence_lag_rows
    assert (*found, settings.confidence) == (3, 12, 12, 0.9)
    assert (
        settings_of(
            AuditSettings(persistence_lag_rows=4), task, HORIZONS, confidence=0.9
        ).chunk_rows
        == 12
    )


@pytest.mark.parametrize(
    ("name", "value", "home"),
    [("observation_horizon", 3, "horizons"), ("chunk_rows", 12, "horizons"),
     ("confidence", 0.9, "confidence")],
)  # fmt: skip
def test_what_is_said_twice_is_refused_even_if_equal(task, name, value, home):
    with pytest.raises(ConfigError, match=rf"audit\.{name}.*`{home}`"):
        settings_of(AuditSettings(**{name: value}), task, HORIZONS, confidence=0.9)


def test_a_named_setting_stands_before_the_tasks_and_before_a_chunk(task):
    named = AuditSettings(persistence_lag_rows=4, calibration_phase="elsewhere")
    settings = settings_of(named, task, HORIZONS, confidence=0.9)
    assert (settings.persistence_lag_rows, settings.calibration_phase) == (4, "elsewhere")
    assert settings.position_channel == task.audit_channels.position


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
