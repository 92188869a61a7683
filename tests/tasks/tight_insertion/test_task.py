"""The tight task as a plug-in: found by name, recorded, planned, refused where it is another's."""

import numpy as np
import pytest

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import ContractError
from genpolicy.tasks.api import WorldSettings, load_task
from genpolicy.tasks.tight_insertion.task import TASK

HORIZONS = HorizonConfig(
    observation_horizon=2, prediction_horizon=16, execution_horizon=8, action_period_s=0.05
)


def test_it_is_registered_and_its_recordings_name_it():
    assert load_task("tight_insertion") is TASK
    specs = TASK.episode_specs(3, 2, shares={"nominal": 1.0})
    episode = TASK.record_episode(specs[0])
    assert episode.metadata["task"] == "tight_insertion"
    assert TASK.start_from_json(episode.metadata["scene_start"]) == specs[0].start
    other = load_task("tabletop_insertion").episode_specs(3, 2, shares={"nominal": 1.0})
    assert load_task("tabletop_insertion").record_episode(other[0]).episode_uuid != (
        episode.episode_uuid
    )


def test_a_start_of_the_tabletop_is_refused():
    start = load_task("tabletop_insertion").sample_start(np.random.default_rng(0))
    with pytest.raises(ContractError, match="expected TightStart"):
        TASK.make_world(start, settings=WorldSettings("epoch_1"))
    with pytest.raises(ContractError, match="expected TightStart"):
        TASK.replay(start, np.zeros((1, 10)))


def test_a_recorded_episode_replays_to_its_outcome():
    spec = TASK.episode_specs(3, 1, shares={"nominal": 1.0})[0]
    episode = TASK.record_episode(spec)
    actions = episode.streams["action"].values
    assert TASK.replay(spec.start, actions) == episode.metadata["outcome"] == "success"
    assert TASK.replay(spec.start, actions[:20]) == "failure"


@pytest.mark.parametrize("seed", range(4))
def test_the_classical_planner_finds_the_hole_from_noisy_views(seed):
    """Asked anew every four rows, as an executor asks; of forty starts it finds forty."""
    start = TASK.sample_start(np.random.default_rng(seed))
    world = TASK.make_world(start, settings=WorldSettings("epoch_1", seed=seed))
    seen = [world.observe()] * 2
    for _ in range(100):
        chunk = TASK.planner(np.stack(seen[-2:]), horizons=HORIZONS)
        for action in chunk[:4]:
            world.command(action)
            world.advance()
            seen.append(world.observe())
        if world.success:
            break
    assert world.success
