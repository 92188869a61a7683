"""What a person is told of each cause stays what was read through."""

import json

import pytest
from golden_causes import DRAWS, FILE, WORLDS, whole

GOLDEN = json.loads(FILE.read_text())


@pytest.fixture(scope="module")
def now():
    return json.loads(json.dumps(whole()))


@pytest.mark.parametrize("world", ["as it is", *WORLDS, *DRAWS])
def test_golden_what_is_said_of_a_cause(world, now):
    assert now[world] == GOLDEN[world]


def test_no_golden_text_is_left_over(now):
    assert list(now) == list(GOLDEN)
