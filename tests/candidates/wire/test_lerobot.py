"""LeRobot's policies over the wire, against an exchange with its own code.

Recorded from `adapters/lerobot_server.py` with ACT of LeRobot 0.6.1, trained by LeRobot's own
script for 300 updates on the export of the default ladder's training split.
"""

import re
from pathlib import Path

import msgpack
import numpy as np
import pytest
import yaml

from genpolicy.candidates.hosts.kinds import LeRobotEntry
from genpolicy.candidates.wire.entry import Entry, ServerEntry
from genpolicy.candidates.wire.packing import pack, unpack
from genpolicy.candidates.wire.remote import RemotePolicy

HERE = Path(__file__).parent
DOCS = HERE.parents[2] / "docs" / "candidates.md"
RECORDED = msgpack.unpackb((HERE / "recorded" / "lerobot_act.msgpack").read_bytes())


@pytest.fixture
def entry():
    """The entry of the docs."""
    [text] = re.findall(r"```yaml\n# lerobot\.yaml\n(.*?)```", DOCS.read_text(), re.DOTALL)
    found = LeRobotEntry.model_validate(yaml.safe_load(re.sub('"@[a-z]+@"', repr("0" * 64), text)))
    same = {name: getattr(found, name) for name in Entry.model_fields if name != "kind"}
    return ServerEntry(**same, kind="server", command=["serve", "{port}"])


def test_it_is_asked_byte_for_byte_and_understood_bit_for_bit(serving, entry, task):
    asked = []

    def answer(message):
        asked.append(pack(message))
        return unpack(RECORDED["exchanges"][len(asked) - 1]["answered"])

    with serving(answer, unpack(RECORDED["metadata"])) as address:
        policy = RemotePolicy(entry, address, task.observation)
        for row, exchange in zip((0, 40), RECORDED["exchanges"], strict=True):
            seen = np.frombuffer(exchange["observations"]).reshape(2, task.observation.dim)
            found = policy.invoke(seen, noise=("recorded", row), candidates=2)
            assert found.actions.tobytes() == exchange["mapped"]
            assert found.evaluations is None
            assert set(found.spans_s) == {"preprocess", "sample"}
        policy.close()
    assert asked == [exchange["asked"] for exchange in RECORDED["exchanges"]]


def test_what_it_says_first_names_inputs_that_the_entry_gives(entry):
    said = unpack(RECORDED["metadata"])
    assert sorted(said["inputs"]) == sorted(entry.observation)
    assert said["n_obs_steps"] == 1
    assert said["genpolicy"]["seeded"]
