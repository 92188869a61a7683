"""What LeRobot's `config.json` says of inputs, columns and rows, held against the entry.

The fields are those of configs that LeRobot 0.6.1 wrote for ACT and Diffusion on our export.
"""

import json

import pytest

from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.hosts.lerobot_shapes import require_shapes
from genpolicy.candidates.hosts.loadable import require_loadable
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.errors import ConfigError
from tests.candidates.conftest import ENTRY

STATE = ["tcp_position_m", "tcp_rotation", "gripper_opening_m"]
ENVIRONMENT = ["wrench_n", "hole_pose", "post_position_m", "phase"]
FEATURES = {
    "observation.state": {"type": "STATE", "shape": [10]},
    "observation.environment_state": {"type": "ENV", "shape": [14]},
}
COMMON = {
    "input_features": FEATURES,
    "output_features": {"action": {"type": "ACTION", "shape": [10]}},
    "device": "cpu",
}
ACT = {**COMMON, "type": "act", "n_obs_steps": 1, "chunk_size": 16, "n_action_steps": 8}
DIFFUSION = {
    **COMMON, "type": "diffusion", "n_obs_steps": 2, "horizon": 20, "n_action_steps": 16,
}  # fmt: skip
ANOTHER = {**COMMON, "type": "another", "chunk_size": 50}


def inputs(history=1, state=STATE, environment=ENVIRONMENT):
    return {
        "observation.state": {"channels": state, "history": history},
        "observation.environment_state": {"channels": environment, "history": history},
    }


@pytest.fixture
def brought(written, task):
    """Requires an entry of a config; gives its path."""

    def require(config, **changes):
        history = config.get("n_obs_steps", 1) if isinstance(config, dict) else 1
        path = written("lerobot", **{"observation": inputs(history), **changes})
        (path.parent / "act" / "config.json").write_text(json.dumps(config))
        require_shapes(read_entry(path), path.parent, task.observation)
        return path

    return require


@pytest.mark.parametrize("config", [ACT, DIFFUSION, ANOTHER], ids=lambda config: config["type"])
def test_what_it_takes_and_gives_is_no_mistake(brought, config):
    brought(config)


@pytest.mark.parametrize("config", [{}, [], {"input_features": None, "output_features": []}])
def test_what_a_config_does_not_say_is_held_against_nothing(brought, config):
    brought(config)


def shaped(name, shape):
    return {**FEATURES, name: {"type": "STATE", "shape": shape}}


@pytest.mark.parametrize(
    ("config", "changes", "told"),
    [
        (ACT, {"observation": inputs(state=STATE[:2])}, r"observation.state .* 9 numbers.* 10 num"),
        ({**ACT, "input_features": shaped("observation.environment_state", [34])}, {},
         r"observation.environment_state .* 14 numbers.* 34 numbers"),
        ({**ACT, "input_features": shaped("observation.images.front", [3, 96, 96])}, {},
         r"observation.environment_state, observation.state, expected .*images.front"),
        ({**ACT, "input_features": {"observation.state": FEATURES["observation.state"]}}, {},
         r"environment_state, observation.state, expected observation.state, as act/config.json"),
        (DIFFUSION, {"observation": inputs(1)}, r"history .* is 1, expected n_obs_steps 2"),
        (ACT, {"observation": inputs(2)}, r"history .* is 2, expected n_obs_steps 1"),
        ({**ACT, "output_features": {"action": {"type": "ACTION", "shape": [7]}}}, {},
         r"10 columns at least, expected 7 numbers of action"),
        (ACT, {"action": {**ENTRY["action"], "key": "action"}}, r"'action', expected 'actions'"),
        ({**ACT, "chunk_size": 100}, {}, r"prediction_horizon .* is 16, expected chunk_size 100"),
        ({**DIFFUSION, "n_action_steps": 8}, {}, r"is 16, expected n_action_steps 8"),
        ({**DIFFUSION, "horizon": 16}, {}, r"is 16 behind 1 of the past, expected horizon 16"),
        ({**ANOTHER, "chunk_size": 8}, {}, r"is 16, expected chunk_size 8"),
    ],
)  # fmt: skip
def test_what_differs_is_refused_with_both_sides(brought, config, changes, told):
    with pytest.raises(ConfigError, match=told):
        brought(config, **changes)


def test_an_input_may_be_constant(brought):
    features = {**FEATURES, "robot": {"type": "STATE", "shape": [1]}}
    brought({**ACT, "input_features": features}, constants={"robot": 3})


def test_it_is_asked_before_all_and_whenever_its_server_would_start(brought, written, task):
    """Wrong before: a policy of other shapes was found out behind all trainings."""
    path = brought({**ACT, "chunk_size": 16})
    (path.parent / "act" / "config.json").write_text(json.dumps({**ACT, "chunk_size": 100}))
    entry = read_entry(path).model_copy(update={"interpreter": __file__})
    for require in (require_loadable, as_server):
        with pytest.raises(ConfigError, match="chunk_size 100"):
            require(entry, path, task.observation)


def test_a_file_that_is_absent_is_refused_where_files_are_verified(written, task):
    path = written("lerobot")
    (path.parent / "act" / "config.json").unlink()
    require_shapes(read_entry(path), path.parent, task.observation)
