"""LeRobot's policies over the wire, against exchanges with its own code.

Recorded (`record_lerobot.py`) from `adapters/lerobot_server.py` with ACT and Diffusion of LeRobot
0.6.1, trained by LeRobot's own script on the export of a training split (1200 and 800 updates).
"""

from pathlib import Path

import msgpack
import numpy as np
import pytest

from genpolicy.candidates.wire.packing import pack, unpack
from genpolicy.candidates.wire.remote import RemotePolicy
from tests.candidates.wire.record_lerobot import CHUNKS, HISTORY, NAMES, entry_of

HERE = Path(__file__).parent
RECORDED = {
    kind: msgpack.unpackb((HERE / "recorded" / f"lerobot_{kind}.msgpack").read_bytes())
    for kind in HISTORY
}
EVALUATIONS = {"act": 1, "diffusion": 8}


@pytest.mark.parametrize("kind", HISTORY)
def test_it_is_asked_byte_for_byte_and_understood_bit_for_bit(serving, kind, task):
    asked, recorded = [], RECORDED[kind]

    def answer(message):
        asked.append(pack(message))
        return unpack(recorded["exchanges"][len(asked) - 1]["answered"])

    with serving(answer, unpack(recorded["metadata"])) as address:
        policy = RemotePolicy(entry_of(kind, ["serve", "{port}"]), address, task.observation)
        for name, exchange in zip(NAMES, recorded["exchanges"], strict=True):
            seen = np.frombuffer(exchange["observations"]).reshape(2, task.observation.dim)
            found = policy.invoke(seen, noise=name, candidates=CHUNKS)
            assert found.actions.tobytes() == exchange["mapped"]
            assert found.evaluations == EVALUATIONS[kind]
            assert set(found.spans_s) == {"preprocess", "encode", "sample"}
            assert found.messages == 1
        policy.close()
    assert asked == [exchange["asked"] for exchange in recorded["exchanges"]]


@pytest.mark.parametrize("kind", HISTORY)
def test_what_it_says_first_names_inputs_that_the_entry_gives(kind):
    said = unpack(RECORDED[kind]["metadata"])
    assert sorted(said["inputs"]) == sorted(entry_of(kind, ["serve", "{port}"]).observation)
    assert said["n_obs_steps"] == HISTORY[kind]
    assert said["genpolicy"]["seeded"]


def test_what_diffusion_drew_for_two_chunks_is_two_chunks():
    first = RECORDED["diffusion"]["exchanges"][0]
    one, other = np.frombuffer(first["mapped"]).reshape(CHUNKS, -1)
    assert not np.array_equal(one, other)
