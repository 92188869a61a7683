"""Which action components command which observed ones: by name, or by numbers."""

import numpy as np
import pytest

from genpolicy.data.formats.contract import ActionSource, ChannelSource
from genpolicy.data.formats.pairing import are_differences, pair_by_name, pair_by_numbers


def channel(name, components, unit="rad", **changes):
    plain = {"columns": [f"{name}[0:{len(components)}]"], "stream": "state"}
    return ChannelSource(name=name, components=components, unit=unit, **{**plain, **changes})


def action(components, units):
    return ActionSource(
        columns=[f"action[0:{len(components)}]"], components=components, units=units
    )


def test_pairs_by_name_need_the_same_name_and_unit():
    joints = ["joint_1", "joint_2", "grip"]
    pairs = pair_by_name([channel("state", joints)], action(joints[::-1], ["rad"] * 3))
    assert pairs == {name: f"state.{name}" for name in joints[::-1]}
    assert pair_by_name([channel("state", joints)], action(joints, ["m"] * 3)) is None
    unnamed = [f"state_{i}" for i in range(3)]
    told = action([f"action_{i}" for i in range(3)], ["rad"] * 3)
    assert pair_by_name([channel("state", unnamed)], told) is None


def test_a_target_elsewhere_does_not_pair():
    channels = [
        channel("tcp_position_m", ["x", "y", "z"], "m"),
        channel("hole_pose", ["x", "y", "z"], "m"),
    ]
    pairs = pair_by_name(channels, action(["tcp_x_m", "tcp_y_m", "tcp_z_m"], ["m"] * 3))
    assert pairs == {f"tcp_{axis}_m": f"tcp_position_m.{axis}" for axis in "xyz"}


def walk(seed, rows=300, width=3):
    return np.cumsum(np.random.default_rng(seed).normal(0, 0.05, (rows, width)), axis=0)


@pytest.mark.parametrize("lag", [0, 2, 5])
def test_pairs_by_numbers_find_a_permutation_behind_a_lag(lag):
    episode = np.repeat(np.arange(6), 50)
    path = walk(1)
    order = [2, 0, 1]
    commanded = np.roll(path, -lag, axis=0)[:, order]
    observed = np.concatenate([path, walk(2)], axis=1)
    assert pair_by_numbers(observed, commanded, episode) == list(enumerate(order))


def test_pairs_by_numbers_claim_nothing_of_strangers_and_velocities():
    episode = np.repeat(np.arange(6), 50)
    hits = sum(pair_by_numbers(walk(s), walk(s + 500), episode) is not None for s in range(40))
    assert hits <= 4
    path = walk(3)
    assert pair_by_numbers(path, np.gradient(path, axis=0), episode) is None
    assert pair_by_numbers(path, 1000 * path, episode) is None
    assert pair_by_numbers(path[:5], path[:5], episode[:5]) is None


def test_differences_are_told_from_positions():
    episode = np.repeat(np.arange(6), 50)
    path = walk(4)
    change = np.diff(path, axis=0, append=path[-1:])
    assert are_differences(path, change, episode)
    assert not are_differences(path, path + 0.01, episode)
    # A fast target leads its response by a quarter turn: it looks like its change, and is a place.
    turn = np.arange(300)[:, None] * 0.4 + np.arange(3)
    assert not are_differences(np.sin(turn), np.sin(turn + np.pi / 2), episode)
    # Slow and short, a change looks like a place; its spread tells.
    slow = np.sin(np.arange(300)[:, None] * 0.02 + np.arange(3))
    assert are_differences(slow, np.diff(slow, axis=0, append=slow[-1:]), episode)
