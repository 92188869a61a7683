"""The action: ten numbers, one order, one hash."""

import hashlib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from genpolicy.contract import action
from genpolicy.contract.action import ACTION_DIM, action_contract_hash, join_action, split_action


@pytest.mark.parametrize("shape", [(), (5,), (2, 3)])
def test_joined_and_split_again(shape):
    generator = np.random.default_rng(0)
    position = generator.normal(size=(*shape, 3))
    rotation = Rotation.random(int(np.prod(shape)), rng=generator).as_matrix()
    rotation = rotation.reshape((*shape, 3, 3))
    opening = generator.uniform(0, 0.04, size=shape)
    joined = join_action(position, rotation, opening)
    assert joined.shape == (*shape, ACTION_DIM)
    for found, expected in zip(split_action(joined), (position, rotation, opening), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_one_opening_serves_all_actions():
    joined = join_action(np.zeros((4, 3)), np.broadcast_to(np.eye(3), (4, 3, 3)), 0.02)
    np.testing.assert_array_equal(joined[:, action.GRIPPER], 0.02)
    np.testing.assert_array_equal(joined[0], [0, 0, 0, 1, 0, 0, 0, 1, 0, 0.02])


def test_a_rotation_that_is_none_is_nan_and_not_repaired():
    position, rotation, opening = split_action(np.zeros(ACTION_DIM))
    assert np.isnan(rotation).all()
    assert np.isfinite(position).all() and opening == 0


def test_the_hash_is_that_of_the_definition():
    """The document is written out here: whoever changes the action changes this line too."""
    names = (
        "tcp_x_m", "tcp_y_m", "tcp_z_m",
        *(f"rotation_column_{c}_{axis}" for c in (0, 1) for axis in "xyz"), "gripper_opening_m",
    )  # fmt: skip
    listed = ",\n".join(f'    "{name}"' for name in names)
    document = (
        f'{{\n  "components": [\n{listed}\n  ],\n  "frame": "robot_base",\n  "version": 1\n}}\n'
    )
    assert action_contract_hash() == hashlib.sha256(document.encode()).hexdigest()


def test_another_order_is_another_contract(monkeypatch):
    before = action_contract_hash()
    swapped = (*action.ACTION_COMPONENTS[1::-1], *action.ACTION_COMPONENTS[2:])
    monkeypatch.setattr(action, "ACTION_COMPONENTS", swapped)
    assert action_contract_hash() != before
