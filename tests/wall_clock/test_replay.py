"""A replay is whole, and says what was seen and commanded up to a row."""

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.wall_clock.replay import Replay


@pytest.fixture
def replay():
    rows = 5
    return Replay(
        episode_uuid="e", calibration_epoch="c", phases=("approach",) * rows,
        observations=tuple((float(n), 0.0) for n in range(rows)),
        actions=tuple((float(n),) * 10 for n in range(rows)), forces_n=(0.0,) * rows,
    )  # fmt: skip


def test_the_first_observation_stands_in_for_those_before(replay):
    assert replay.history(0, 3)[:, 0].tolist() == [0, 0, 0]
    assert replay.history(3, 2)[:, 0].tolist() == [2, 3]


def test_commands_end_at_the_row(replay):
    assert replay.commanded(4)[:, 0].tolist() == [2, 3, 4]
    assert replay.commanded(1)[:, 0].tolist() == [0, 0, 1]


@pytest.mark.parametrize("name", ["phases", "observations", "actions", "forces_n"])
def test_columns_of_another_length_are_refused(name, replay):
    document = replay.model_dump()
    document[name] = document[name][:-1]
    with pytest.raises(ContractError, match="one phase, observation, action and force per row"):
        Replay(**document)


def test_it_comes_back_bit_for_bit(replay):
    value = float(np.nextafter(0.1, 1))
    odd = replay.model_copy(update={"forces_n": (value,) * 5})
    assert Replay.model_validate_json(odd.model_dump_json()).forces_n == (value,) * 5
