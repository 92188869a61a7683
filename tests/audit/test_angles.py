"""Commanded angles without a jump, each episode at the turn of the others."""

from dataclasses import replace

import numpy as np
import pytest
from planar import planar
from scipy.spatial.transform import Rotation

from genpolicy.audit.angles import turn_of, without_jumps
from genpolicy.audit.data import canonical

ROWS, EPISODES = 40, 6
EPISODE = np.repeat(np.arange(EPISODES), ROWS)
FULL = 2.0 * np.pi


def wrapped(angle, turn=FULL):
    return (angle + turn / 2) % turn - turn / 2


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.mark.parametrize("turn", [FULL, 360.0])
def test_an_angle_about_half_a_turn_is_one_number(rng, turn):
    true = turn / 2 + 0.01 * turn * rng.normal(size=len(EPISODE)).cumsum() / 10
    given = wrapped(true, turn)
    assert np.ptp(given) > 0.9 * turn
    found = without_jumps(given[:, None], EPISODE, np.array([0]))[:, 0]
    np.testing.assert_allclose((found - true) / turn, np.round((found - true)[0] / turn), atol=1e-9)


def test_an_angle_of_either_sign_in_each_episode_is_one_number(rng):
    signs = np.where(np.arange(EPISODES) % 2, 1.0, -1.0)[EPISODE]
    given = signs * (np.pi - 0.01 * rng.random(len(EPISODE)))
    assert np.ptp(without_jumps(given[:, None], EPISODE, np.array([0]))) < 0.03


def test_two_ways_stay_two_ways(rng):
    # Half a turn to the left or to the right: no jump, and what lies between is gone through.
    ways = np.where(np.arange(EPISODES) % 2, 1.0, -1.0)[EPISODE]
    given = ways * np.tile(np.linspace(0.0, np.pi, ROWS), EPISODES)
    assert turn_of(given, EPISODE) == 0.0


@pytest.mark.parametrize(
    "values",
    [np.tile(np.repeat([-np.pi, np.pi], ROWS // 2), EPISODES),
     np.tile(np.linspace(-3.0, 3.0, ROWS), EPISODES),
     np.tile(np.linspace(0.0, 0.4, ROWS), EPISODES), np.zeros(len(EPISODE))],
    ids=["a hand of two values", "a long way", "a short way", "nothing"],
)  # fmt: skip
def test_other_numbers_are_left_to_the_byte(values):
    given = np.stack([values, values], axis=1)
    assert without_jumps(given, EPISODE, np.arange(2)) is given


def quaternions(rng):
    """Rotations about half a turn that go on smoothly, as (N, 4)."""
    ways = 0.05 * rng.normal(size=(len(EPISODE), 3)).cumsum(axis=0) / 5 + [np.pi, 0.0, 0.0]
    return Rotation.from_rotvec(ways).as_quat(canonical=True)


def test_a_quaternion_of_either_sign_is_one_number(rng):
    true = quaternions(rng)
    flips = rng.choice([-1.0, 1.0], EPISODES)[EPISODE]
    flips *= np.where(np.arange(len(EPISODE)) % ROWS < 11, 1.0, -1.0)
    beside = rng.normal(size=(len(EPISODE), 2))
    given = np.concatenate([beside, flips[:, None] * true], axis=1)
    found = without_jumps(given, EPISODE, np.arange(6))
    np.testing.assert_array_equal(found[:, :2], beside)
    inside = np.diff(EPISODE) == 0
    assert np.abs(np.diff(found[:, 2:], axis=0)[inside]).max() < 0.2
    assert ((found[::ROWS, 2:] * found[0, 2:]).sum(axis=1) > 0.5).all()
    # Whoever has the numbers beside not at hand sees the same.
    np.testing.assert_array_equal(without_jumps(given, EPISODE, np.arange(2, 6)), found)


def test_the_order_of_episodes_changes_no_sign_against_the_others(rng):
    true = quaternions(rng)
    given = rng.choice([-1.0, 1.0], EPISODES)[EPISODE][:, None] * true
    found = without_jumps(given, EPISODE, np.arange(4))
    behind = given.reshape(EPISODES, ROWS, 4)[::-1].reshape(-1, 4)
    turned = without_jumps(behind, EPISODE, np.arange(4))
    turned = turned.reshape(EPISODES, ROWS, 4)[::-1].reshape(-1, 4)
    assert np.array_equal(turned, found) or np.array_equal(turned, -found)


def test_flags_and_what_is_read_otherwise_are_no_quaternion(rng):
    flags = np.eye(4)[rng.integers(0, 4, len(EPISODE))] * -1.0
    assert without_jumps(flags, EPISODE, np.arange(4)) is flags
    given = np.where(EPISODE % 2, -1.0, 1.0)[:, None] * quaternions(rng)
    assert without_jumps(given, EPISODE, np.array([0, 1, 3])) is given


def test_only_what_nothing_observed_answers_is_made_continuous(rng):
    data = canonical(planar()[0])
    jumps = wrapped(np.pi + 0.02 * rng.normal(size=len(data.action)))
    one = replace(data, action=np.concatenate([data.action, jumps[:, None]], axis=1))
    assert np.ptp(one.placed[:, -1]) < 1.0
    np.testing.assert_array_equal(one.placed[:, :-1], data.action)
    assert np.ptp(one.action[:, -1]) > 6.0
