"""Recovery goes by its table, and the policy commands nothing meanwhile."""

from itertools import pairwise

import pytest

from genpolicy.execution.cell import PRIMITIVES as OF_THE_MACHINE
from genpolicy.verification.recovering import PRIMITIVES, Recovering


def rules(*states, policy=False):
    recovering = Recovering()
    events = [("recovery", {"old": old, "new": new}) for old, new in pairwise(states)]
    events += [("accept", {})] * policy
    return [rule for kind, m in events for rule, _ in recovering.follow(kind, m)]


def test_the_ways_that_there_are():
    assert set(PRIMITIVES) == set(OF_THE_MACHINE)
    assert rules("idle", "hold", "retreat", "classical_return", "idle", policy=True) == []
    assert rules("idle", "hold", "retreat", "hold", "ask_human", "person", "idle") == []
    assert rules("idle", "hold", "ask_human", "abort", "stopped", "idle", policy=True) == []
    assert rules("idle", "stopped") == rules("idle", "hold", "retreat", "abort") == []


@pytest.mark.parametrize(
    "states",
    [("idle", "retreat"), ("idle", "hold", "idle"), ("hold", "retreat"), ("idle", "hold", "person"),
     ("idle", "hold", "retreat", "person"), ("idle", "hold", "retreat", "retreat"),
     ("idle", "hold", "stopped", "retreat"), ("idle", "stopped", "stopped"),
     ("idle", "hold", "levitate")],
)  # fmt: skip
def test_another_way_is_found(states):
    assert rules(*states) == ["P8.recovery"]


def test_the_policy_s_action_in_recovery_is_found():
    assert rules("idle", "hold", policy=True) == ["P8.recovery"]
