"""An entry of kind `trained` is held against what its checkpoint says of itself."""

import pytest

from genpolicy.candidates.described import architecture_of, evaluations_of, path_of
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.hosts.serving import hosted
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.errors import ConfigError
from genpolicy.policies.policy import load_policy
from tests.candidates.conftest import CHANNELS, ENTRY

ANCHOR = {"position": ["tcp_position_m"], "rotation": ["tcp_rotation"]}
ACTION = ENTRY["action"]
OBSERVED = ENTRY["observation"]["observation"]
QUATERNION = {"columns": [3, 4, 5, 6], "form": "quaternion_xyzw"}
JOINTS = {
    "motion": "absolute",
    "joints": {"columns": [0, 1, 2, 3, 4, 5, 6], "unit": "rad"},
    "gripper": {"column": 7, "open": 1.0, "open_m": 1.0},
}


@pytest.fixture
def declared(fleet):
    """What is true of a checkpoint, by method."""

    def of(method="flow"):
        policy = load_policy(fleet[0] / method / "seed_0")
        config, sampler = policy.checkpoint.config, policy.sampler
        return {
            "dataset": config.provenance.dataset_manifest_sha256,
            "split": "1" * 64,
            "training_seed": config.training_seed,
            "architecture": architecture_of(config),
            "parameters": config.parameters["total"],
            "path": path_of(config, sampler),
            "sampler": sampler.name,
            "sampler_steps": sampler.steps,
            "evaluations": int(evaluations_of(sampler).partition(" ")[0]),
            "precision": "float32",
            "device": "cpu",
            "threads": 1,
            "cpu_capability": "whatever it runs on",
            "batch_rows": sampler.batch_rows,
        }

    return of


def host(path, task, **changes):
    known = {"widths": {"observation": task.observation.dim},
             "observation": task.observation.hash()}  # fmt: skip
    return hosted(path, sha256=None, **{**known, **changes})


@pytest.mark.parametrize("method", ["flow", "chunked_bc"])
def test_what_is_true_is_hosted(checkpoint, declared, task, method):
    policy = host(checkpoint(method, stochastic=method == "flow", declared=declared(method)), task)
    assert policy.metadata["method"] == method


def test_who_declares_nothing_and_does_not_know_what_is_in_force_is_hosted(checkpoint, task):
    assert host(checkpoint(), task, widths={}, observation=None)
    # The same metres, said with other numbers; H_e is how chunks are used.
    horizons = {**ENTRY["horizons"], "execution_horizon": 4}
    gripper = {"column": 9, "open": 0.04, "open_m": 0.04}
    assert host(checkpoint(action={**ACTION, "gripper": gripper}, horizons=horizons), task)


WRONG = {
    "dataset": "0" * 64, "training_seed": 7, "architecture": "transformer of 12 layers",
    "parameters": 1, "path": "none", "sampler": "heun", "sampler_steps": 9, "evaluations": 99,
    "precision": "float16", "batch_rows": 3, "eta": 0.5, "tolerance": 0.1,
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_an_item_that_the_checkpoint_knows_otherwise_names_both(checkpoint, declared, task, name):
    """Wrong before: a card of another policy stood, and Gate B said that nobody checks it."""
    true = declared()
    path = checkpoint(declared={**true, name: WRONG[name]})
    with pytest.raises(ConfigError, match=r"as `config\.json` of its checkpoint says") as error:
        host(path, task)
    said = [error.value.found, error.value.expected]
    assert all(f"declared.{name} " in one and one.count("declared.") == 1 for one in said)
    shown = WRONG[name] if name != "dataset" else "0" * 16
    assert str(shown) in said[0] and str(true.get(name))[:16] in said[1]


def test_all_that_differs_is_said_at_once(checkpoint, declared, task):
    other = {"sampler": "heun", "sampler_steps": 9, "training_seed": 7}
    with pytest.raises(ConfigError) as error:
        host(checkpoint(declared={**declared(), **other}), task)
    assert error.value.found == (
        "declared.training_seed 7; declared.sampler 'heun'; declared.sampler_steps 9"
    )


@pytest.mark.parametrize(
    ("action", "told"),
    [
        ({"position": {"columns": [0, 1, 2], "unit": "mm"}}, r"unit 'mm'.*unit 'm'"),
        ({"position": {"columns": [1, 0, 2], "unit": "m"}}, r"\[1, 0, 2\].*\[0, 1, 2\]"),
        ({"motion": "relative", "frame": "tcp", "anchor": ANCHOR}, "'relative'.*'tcp'.*'absolute'"),
        ({"rotation": QUATERNION}, "'quaternion_xyzw'.*'rotation_6d'"),
        ({"gripper": {"column": 9, "open": 0.08, "open_m": 0.04}}, r"gripper 0.5, .* 1, as"),
        ({"gripper": {"column": 9, "open": 1.0, "closed": 0.5, "open_m": 1.0}}, "closed 0.5"),
        ({"key": "chunk"}, "'chunk'.*'actions'"),
    ],
)  # fmt: skip
def test_another_action_than_the_one_of_a_checkpoint(checkpoint, task, action, told):
    with pytest.raises(ConfigError, match=told):
        host(checkpoint(action={**ACTION, **action}), task)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"action": JOINTS}, "action 'joints'.*action 'places of the TCP'"),
        ({"stochastic": False}, "stochastic False.*stochastic True"),
        ({"horizons": {**ENTRY["horizons"], "action_period_s": 0.1}}, "0.1.*0.05"),
        ({"horizons": {**ENTRY["horizons"], "prediction_horizon": 32}}, "32.*16"),
    ],
)
def test_other_horizons_or_another_space(checkpoint, task, changes, told):
    with pytest.raises(ConfigError, match=told):
        host(checkpoint(**changes), task)


def test_one_that_always_draws_the_same_is_not_said_to_differ(checkpoint, task):
    with pytest.raises(ConfigError, match=r"stochastic True.*stochastic False"):
        host(checkpoint("chunked_bc"), task)
    assert host(checkpoint("chunked_bc", stochastic=False), task)


def test_another_observation_than_it_was_trained_on(checkpoint, task):
    with pytest.raises(ConfigError, match=r"observation contract .*observation contract 0000"):
        host(checkpoint(), task, observation="0" * 64)
    with pytest.raises(ConfigError, match=r"numbers of observation 24.*numbers of observation 9"):
        host(checkpoint(), task, widths={"observation": 9})


@pytest.mark.parametrize(
    "channels",
    [
        ["tcp_position_m", "tcp_rotation"],
        [*CHANNELS[1:], CHANNELS[0]],
        [*CHANNELS, "phase"],
    ],
    ids=["fewer", "another order", "one twice"],
)
def test_a_part_of_the_observation_or_another_order(written, task, channels):
    """Wrong before: 9 of 24 numbers reached the stage that reloads, behind all trainings."""
    path = written("trained", observation={"observation": {**OBSERVED, "channels": channels}})
    with pytest.raises(ConfigError, match=r"channels of the candidate planted.*24 numbers"):
        as_server(read_entry(path), path, task.observation)


def test_single_numbers_of_all_channels_in_their_order_are_the_observation(written, task):
    given = {**OBSERVED, "channels": list(task.observation.component_names)}
    path = written("trained", observation={"observation": given})
    command = as_server(read_entry(path), path, task.observation).command
    assert command[-2:] == ["--observation", task.observation.hash()]
