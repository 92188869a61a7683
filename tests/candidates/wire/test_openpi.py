"""The wire against bytes of openpi's own client package (`record_openpi.py`, version 0.1.2)."""

import msgpack
import numpy as np
import pytest
from websockets.sync.client import connect

from genpolicy.candidates.wire.packing import pack, unpack
from genpolicy.candidates.wire.remote import RemotePolicy
from tests.candidates.conftest import ENTRY
from tests.candidates.wire.record_openpi import (
    METADATA,
    PROMPT,
    RECORDED,
    answer,
    observation,
    raw_server,
)

KEPT = msgpack.unpackb(RECORDED.read_bytes())
THEIRS, OURS = KEPT["theirs"], KEPT["ours"]


def same(found, expected):
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        if isinstance(value, dict):
            same(found[name], value)
        elif isinstance(value, np.ndarray):
            assert (found[name].dtype, found[name].shape) == (value.dtype, value.shape)
            assert found[name].tobytes() == value.tobytes()
        else:
            assert (found[name], type(found[name])) == (value, type(value))


@pytest.mark.parametrize(("part", "said"), [
    ("metadata", METADATA), ("asked", observation()), ("answered", answer()),
])  # fmt: skip
def test_both_pack_the_same_bytes_and_what_theirs_packs_is_read_here(part, said):
    same(unpack(THEIRS[part]), said)
    assert pack(said) == THEIRS[part] == OURS[part]


def test_a_server_that_packs_as_openpi_is_asked_byte_for_byte_as_its_client_asks(task, entry_of):
    asked = []

    def talk(line):
        line.send(THEIRS["metadata"])
        for data in line:
            asked.append(data)
            line.send(THEIRS["answered"])

    plain = ENTRY["observation"]["observation"]
    state = {"channels": ["tcp_position_m", "tcp_rotation", "gripper_opening_m"], "history": 1}
    given = {"observation": plain, "observation/state": {**state, "dtype": "float32"}}
    with raw_server(talk) as address:
        entry = entry_of(observation=given, constants={"prompt": PROMPT})
        policy = RemotePolicy(entry, address, task.observation)
        seen = np.random.default_rng(0).normal(size=(2, task.observation.dim))
        found = policy.invoke(seen, noise=("a",), candidates=2)
        policy.close()
    assert (policy.told.version, found.messages, found.evaluations) == (0, 2, None)
    wanted = answer()["actions"].astype(np.float64)
    np.testing.assert_array_equal(found.actions[:, :, :3], np.stack([wanted[:, :3]] * 2))
    # What was asked has the names and forms of what their client sent.
    for data in asked:
        same(
            {name: np.zeros_like(part) if isinstance(part, np.ndarray) else part
             for name, part in unpack(data).items()},
            {name: np.zeros_like(part) if isinstance(part, np.ndarray) else part
             for name, part in unpack(THEIRS["asked"]).items()},
        )  # fmt: skip
        assert len(data) == len(THEIRS["asked"])


def test_their_client_reads_a_server_of_ours_and_ours_answers_what_it_was_asked(serving):
    asked = []

    def answered(message):
        asked.append(message)
        return answer()

    with serving(answered, METADATA) as address, connect(address, compression=None) as line:
        assert line.recv() == OURS["metadata"]
        line.send(OURS["asked"])
        assert line.recv() == OURS["answered"]
    same(asked[0], observation())
    for kept in (THEIRS, OURS):
        assert kept["read_metadata"] and kept["read_dtype"] == "<f4"
        assert kept["read_actions"] == answer()["actions"].tobytes()
