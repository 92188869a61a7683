"""What one tick hands on is what was admitted, bit for bit, and cannot be changed."""

import pytest

from genpolicy.evidence.shadow.rig import Rig


def test_actions_are_read_only_and_bitwise_those_admitted():
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    rig.deliver(chunk)
    command = rig.executor.tick(0.0)
    assert command.action.tobytes() == chunk.actions[0].tobytes()
    with pytest.raises(ValueError, match="read-only"):
        command.action[0] = 1.0
