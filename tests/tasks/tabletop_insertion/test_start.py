"""Starts: drawn in their ranges, there and back through JSON."""

import pytest

from genpolicy.errors import ContractError
from genpolicy.seeds import stream
from genpolicy.tasks.tabletop_insertion.start import sample_start, start_from_json


def test_start_survives_json_and_refuses_other_text():
    start = sample_start(stream(3, "start"))
    assert start_from_json(start.to_json()) == start
    with pytest.raises(ContractError, match="scene_start"):
        start_from_json('{"tcp_x_m": 0.3}')
    with pytest.raises(ContractError, match=r"scene_start\.yaw_rad is True"):
        start_from_json(start.to_json().replace(repr(start.yaw_rad), "true"))
