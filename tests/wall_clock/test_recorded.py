"""An episode of a dataset as a replay."""

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.wall_clock.recorded import replay_of


def test_every_row_of_the_episode_is_there(data, task):
    number = 3
    uuid = str(data.episodes["episode_uuid"].iloc[number])
    replay = replay_of(data, task, uuid)
    rows = data.frames.episode == number
    assert len(replay) == int(data.episodes["rows"].iloc[number]) == rows.sum()
    assert np.array_equal(replay.observation_rows, data.frames.observation[rows])
    assert np.array_equal(replay.action_rows, data.frames.action[rows])
    assert list(replay.phases) == data.frames.phase[rows].tolist()
    assert replay.calibration_epoch == data.episodes["calibration_epoch"].iloc[number]


def test_forces_are_the_size_of_what_is_in_newtons(data, task):
    uuid = str(data.episodes["episode_uuid"].iloc[0])
    replay = replay_of(data, task, uuid)
    wrench = replay.observation_rows[:, task.observation.slices["wrench_n"]]
    assert replay.forces_n == pytest.approx(np.sqrt((wrench**2).sum(axis=1)))


def test_an_episode_that_is_not_there_is_refused(data, task):
    with pytest.raises(ContractError, match="one of the 10 episodes"):
        replay_of(data, task, "nobody")
