"""A number that knows two values."""

import numpy as np
import pytest

from genpolicy.data.grips import is_two_valued


@pytest.mark.parametrize(
    ("values", "known"),
    [
        (np.where(np.arange(100) % 7, 1.0, -1.0), True),
        (np.zeros(10), True),
        (np.concatenate([np.zeros(50), np.ones(45), np.linspace(0, 1, 5)]), True),
        (np.arange(100.0), False),
        (np.tile([0.0, 0.5, 1.0], 30), False),
    ],
)
def test_two_values_are_a_hand(values, known):
    assert is_two_valued(values) is known
