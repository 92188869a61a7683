import numpy as np
import pytest

from genpolicy.candidates.wire.extension import WORD, capabilities
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.errors import ContractError


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
    here = policy.sample(seen[None], noise_names=[("stress", 5, 0)], candidates=4)
    assert found.actions.tobytes() == here.actions[0].tobytes()
    assert found.evaluations == here.nfe
    assert set(found.spans_s) == {"preprocess", "encode", "sample"}


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
        ({"observation": np.zeros(3)}, "ndarray"),
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
