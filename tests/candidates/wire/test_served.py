import numpy as np
import pytest

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.wire.extension import WORD, capabilities
from genpolicy.candidates.wire.mapping import Outputs
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.contract.action import join_action, split_action
from genpolicy.errors import ContractError
from genpolicy.policies.policy import load_policy
from genpolicy.policies.prefix import Prefix


@pytest.fixture
def served(policy):
    return ServedPolicy(policy)


@pytest.fixture
def seen(data):
    return data.windows("test", 2, 16).observations[0]


def asked(seen, **changes):
    said = {"invocation": "1", "noise": ["a", 1], "candidates": 3, **changes}
    return {"observation": seen, WORD: said}


def test_it_says_what_it_is(served, policy):
    told = capabilities(served.metadata)
    assert (told.checkpoint, told.sampler) == (policy.checkpoint_hash, policy.sampler_config_hash)
    assert told.seeded
    assert told.prediction_horizon == 16


def test_behind_the_wire_it_draws_what_it_draws_here_bit_for_bit(served, policy, serving, entry,
                                                                 task, seen):  # fmt: skip
    with serving(served.answer, served.metadata) as address:
        remote = RemotePolicy(entry, address, task.observation)
        found = remote.invoke(seen, noise=("stress", 5), candidates=4)
        remote.close()
    here = policy.sample(seen[None], noise_names=[("stress", 5)], candidates=4)
    assert found.actions.tobytes() == here.actions[0].tobytes()
    assert found.evaluations == here.nfe
    assert set(found.spans_s) == {"preprocess", "encode", "sample"}


def going_on(**changes):
    said = {"actions": np.zeros((16, 10)), "weights": np.zeros(16), "frozen": 0, "bound": 5.0}
    return {**said, **changes}


@pytest.fixture
def plan(policy, seen):
    """What a chunk is to go on from: the beginning of another draw, and falling weights."""
    drawn = policy.sample(seen[None], noise_names=[("plan",)], candidates=1).actions[0]
    weights = np.concatenate([np.ones(2), np.linspace(0.9, 0.1, 6), np.zeros(8)])
    drawn = join_action(*split_action(drawn))  # poses, as what was commanded is
    drawn[0, weights == 0.0] = 0.0  # as the rule leaves them: of no consequence
    return Prefix(drawn, weights[None], 5.0)


def test_a_prefix_behind_the_wire_draws_what_it_draws_here_bit_for_bit(
    served, policy, serving, entry, task, seen, plan, tmp_path
):
    brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
    with serving(served.answer, served.metadata) as address:
        remote = RemotePolicy(entry, address, task.observation)
        wire = WirePolicy(brought, remote)
        assert wire.guided
        found = wire.sample(seen[None], noise_names=[("s", 5)], candidates=4, prefix=plan)
        remote.close()
    asking = {"noise_names": [("s", 5)], "candidates": 4}
    here = policy.sample(seen[None], **asking, prefix=plan)
    assert found.actions.tobytes() == here.actions.tobytes()
    assert found.nfe == here.nfe
    plain = policy.sample(seen[None], **asking)
    assert (here.actions != plain.actions).any() and here.nfe > plain.nfe


def test_a_prefix_in_another_form_draws_the_same_within_a_millionth(
    served, policy, serving, entry_of, task, seen, plan, tmp_path
):
    """A server that speaks of mm and quaternions from the hand; its chunks are the same."""
    entry = entry_of(action={
        "frame": "tcp", "motion": "increments", "position": {"columns": [0, 1, 2], "unit": "mm"},
        "rotation": {"columns": [3, 4, 5, 6], "form": "quaternion_wxyz"},
        "gripper": {"column": 7, "closed": 1.0, "open": 0.0, "open_m": 0.04},
        "anchor": {"position": ["tcp_position_m"], "rotation": ["tcp_rotation"]},
    })  # fmt: skip
    outputs = Outputs(entry.action, task.observation)

    def answer(message):
        """Its own form in and out, around our checkpoint."""
        at = message["observation"][-1]
        said = {**message, WORD: dict(message[WORD])}
        own = dict(said[WORD]["prefix"])
        own["actions"] = outputs.mapped(own["actions"][None], at)[0]
        said[WORD]["prefix"] = own
        drawn = served.answer(said)
        return {**drawn, "actions": np.stack([outputs.written(c, at) for c in drawn["actions"]])}

    with serving(answer, served.metadata) as address:
        remote = RemotePolicy(entry, address, task.observation)
        brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
        found = WirePolicy(brought, remote).sample(
            seen[None], noise_names=[("s", 5)], candidates=2, prefix=plan
        )
        remote.close()
    here = policy.sample(seen[None], noise_names=[("s", 5)], candidates=2, prefix=plan)
    found_at, found_turned, found_open = split_action(found.actions)
    at, turned, opened = split_action(here.actions)
    np.testing.assert_allclose(found_at, at, atol=1e-6)
    np.testing.assert_allclose(found_turned, turned, atol=1e-6)
    np.testing.assert_allclose(found_open, opened, atol=1e-6)


@pytest.mark.parametrize("changes", [
    {"actions": np.zeros((15, 10))}, {"actions": np.full((16, 10), np.nan)},
    {"actions": [[0.0]]}, {"weights": np.zeros(15)}, {"weights": np.full(16, 1.5)},
    {"weights": np.full(16, -0.1)}, {"bound": 0.0}, {"bound": "5"}, {"bound": float("inf")},
    {"more": 1},
])  # fmt: skip
def test_a_prefix_that_is_none_is_refused_by_name(served, seen, changes):
    prefix = going_on(**changes)
    with pytest.raises(ContractError, match=r"genpolicy\.prefix"):
        served.answer(asked(seen, prefix=prefix))


def test_a_checkpoint_that_cannot_be_guided_says_so_and_takes_no_prefix(fleet, seen):
    plain = ServedPolicy(load_policy(fleet[0] / "chunked_bc" / "seed_0"))
    assert not capabilities(plain.metadata).prefix
    with pytest.raises(ContractError, match="no path to guide"):
        plain.answer(asked(seen, prefix=going_on()))


def test_a_plain_client_gets_one_chunk_of_a_fixed_sequence(served, policy, seen):
    drawn = [served.answer({"observation": seen})["actions"] for _ in range(2)]
    again = [ServedPolicy(policy).answer({"observation": seen})["actions"] for _ in range(1)]
    assert drawn[0].shape == (16, 10)
    assert (drawn[0] != drawn[1]).any()
    assert (drawn[0] == again[0]).all()


def test_equal_names_are_equal_chunks_whatever_was_asked_between(served, seen):
    first = served.answer(asked(seen))["actions"]
    served.answer({"observation": seen})
    served.answer(asked(seen, noise=["b"]))
    assert served.answer(asked(seen))["actions"].tobytes() == first.tobytes()


@pytest.mark.parametrize(
    ("message", "found"),
    [
        ({}, "NoneType"),
        ({"observation": [[1.0]]}, "list"),
        ({"observation": np.zeros(3)}, "of shape (1, 1, 3)"),
        ({"observation": np.zeros((1, 2, 3))}, "ndarray of shape (1, 2, 3)"),
        ({"observation": np.zeros((2, 3))}, "of shape"),
        ({"observation": np.zeros((2, 3)), WORD: 1}, "1"),
        ({"observation": np.zeros((2, 3)), WORD: {"noise": []}}, "noise"),
    ],
)
def test_a_message_that_is_none_is_refused_with_what_is_wrong(served, message, found):
    with pytest.raises(ContractError) as error:
        served.answer(message)
    assert found in error.value.found


@pytest.mark.parametrize(
    "changes",
    [
        {"invocation": 1}, {"invocation": "x" * 65}, {"noise": "a"}, {"noise": [1.5]},
        {"noise": [True]}, {"noise": ["a"] * 65}, {"candidates": 0}, {"candidates": 65},
        {"candidates": True}, {"candidates": "3"},
    ],
)  # fmt: skip
def test_an_extension_that_is_none_is_refused(served, seen, changes):
    with pytest.raises(ContractError, match=next(iter(changes))):
        served.answer(asked(seen, **changes))
