"""Four numbers that are one rotation."""

import numpy as np
import pytest

from genpolicy.data.formats.quaternions import is_quaternion


def unit(rows=200, seed=0):
    values = np.random.default_rng(seed).normal(size=(rows, 4))
    return values / np.linalg.norm(values, axis=1, keepdims=True)


def test_unit_norm_is_a_rotation_whatever_its_signs():
    values = unit()
    assert is_quaternion(values)
    assert is_quaternion(values * np.where(np.arange(200) % 3, 1, -1)[:, None])
    values[7] = np.nan
    assert is_quaternion(values)  # one damaged row


@pytest.mark.parametrize(
    "values",
    [
        unit() * 1.1,
        unit()[:, :3],
        unit()[:0],
        np.eye(4)[np.arange(200) % 4],  # which of four phases
        np.random.default_rng(1).uniform(-1, 1, (200, 4)),
    ],
)
def test_what_is_none(values):
    assert not is_quaternion(values)
