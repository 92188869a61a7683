"""Channels that an entry names: where they stand, and which there are if they do not."""

import pytest

from genpolicy.candidates.wire.channels import columns_of
from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.errors import ContractError

CONTRACT = ObservationContract((
    Channel("place_m", ("x", "y", "z"), "m", "robot", 0.1),
    Channel("turn", tuple("abcdef"), "1", "robot", 0.1),
    Channel("hole", ("x_m", "yaw"), "1", "camera", 0.1),
))  # fmt: skip


def test_channels_and_single_numbers_in_the_order_of_their_names():
    found = columns_of(["hole.yaw", "place_m"], CONTRACT, where="observation.state")
    assert found.tolist() == [10, 0, 1, 2]


@pytest.mark.parametrize("name", ["place", "place_m.w", "x", ""])
def test_a_channel_that_is_not_there_is_refused_with_those_that_are(name):
    with pytest.raises(ContractError, match="place_m, turn, hole") as error:
        columns_of([name], CONTRACT, where="observation.state")
    assert "observation.state of the candidate" in error.value.where
