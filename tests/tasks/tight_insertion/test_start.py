"""Starts of the tight task: what is drawn, what is hidden, and a post that may be absent."""

import json

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.tasks.tabletop_insertion import start as tabletop
from genpolicy.tasks.tight_insertion.start import (
    HIDDEN,
    LEFT_OUT_SHARE,
    LEFT_OUT_Y_M,
    PLACES,
    sample_start,
    start_from_json,
)

DRAWN = [sample_start(np.random.default_rng(seed)) for seed in range(2000)]


def test_a_start_survives_json_and_a_start_of_the_other_task_is_none():
    assert start_from_json(DRAWN[0].to_json()) == DRAWN[0]
    other = tabletop.sample_start(np.random.default_rng(0)).to_json()
    with pytest.raises(ContractError, match="grip_x_m"):
        start_from_json(other)
    with pytest.raises(ContractError, match="exactly the names"):
        tabletop.start_from_json(DRAWN[0].to_json())


@pytest.mark.parametrize("name", HIDDEN)
def test_what_is_hidden_must_be_a_finite_number_too(name):
    values = json.loads(DRAWN[0].to_json()) | {name: None}
    with pytest.raises(ContractError, match=name):
        start_from_json(json.dumps(values))


@pytest.mark.parametrize("name", [*PLACES, *HIDDEN])
def test_every_number_fills_its_range(name):
    centre, half = (PLACES | HIDDEN)[name]
    found = np.array([getattr(start, name) for start in DRAWN if not start.post_left_out])
    assert np.all(np.abs(found - centre) <= half)
    assert np.ptp(found) > 1.95 * half


def test_the_post_is_left_out_in_its_share_of_the_starts():
    """Within four standard deviations of a share of 2,000."""
    out = np.mean([start.post_left_out for start in DRAWN])
    assert abs(out - LEFT_OUT_SHARE) < 4 * np.sqrt(LEFT_OUT_SHARE * (1 - LEFT_OUT_SHARE) / 2000)
    assert {start.post_y_m for start in DRAWN if start.post_left_out} == {LEFT_OUT_Y_M}
