"""Directions: what has length one has no unit, and a quaternion no sign."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms
from robots import chosen, robot, waiting

from genpolicy.audit.semantics import measure
from genpolicy.audit.semantics.directions import blocks, directional, one_sign
from genpolicy.seeds import stream


def rotations(n, seed=1):
    q = stream(seed, "rotations").normal(size=(n, 4)).cumsum(axis=0)
    q[:, 3] += 5.0
    return q / np.linalg.norm(q, axis=1)[:, None]


def test_blocks_are_found_beside_lengths_and_flags():
    angle = stream(2, "angle").uniform(0, 6, 300)
    length = stream(2, "length").normal(size=(300, 2))
    flag = np.column_stack([np.ones(300), np.zeros(300)])
    values = np.column_stack([length, rotations(300), flag, np.cos(angle), np.sin(angle)])
    assert blocks(values) == (slice(2, 6), slice(8, 10))
    assert directional(values).tolist() == [False] * 2 + [True] * 4 + [False] * 2 + [True] * 2
    assert blocks(np.float32(values).astype(float)) == blocks(values)
    assert blocks(1.1 * values) == ()
    assert blocks(values[:0]) == ()


def test_six_numbers_of_a_rotation_are_two_directions():
    columns = np.linalg.qr(stream(3, "frames").normal(size=(200, 3, 3)))[0]
    assert blocks(columns[:, :, :2].transpose(0, 2, 1).reshape(200, 6)) == (
        slice(0, 3), slice(3, 6),
    )  # fmt: skip


def test_signs_inside_and_between_episodes_are_made_one():
    rng, starts = stream(4, "signs"), np.array([0, 60, 60, 130])
    true = np.vstack([rotations(60, 5), rotations(70, 6)])
    one = true * rng.choice([-1.0, 1.0], size=(130, 1))
    other = true * rng.choice([-1.0, 1.0], size=(130, 1))
    one_sign(one, other, starts)
    assert np.allclose(one, other) and np.allclose(np.abs(one), np.abs(true))
    for first, last in ((0, 60), (60, 130)):
        assert np.all((one[first + 1 : last] * one[first : last - 1]).sum(axis=1) > 0)


def test_a_rotation_that_differs_by_a_constant_turn_has_no_unit():
    # Commanded near the identity the fourth number hardly moves; seen elsewhere it moves a lot.
    data = robot("tool", 3)
    assert measure(data, SETTINGS).findings == ()
    assert measure(waiting(data, same=False), SETTINGS).findings == ()


def state(data, seed):
    """A whole state of a simulator: time, counter, constants, positions, velocities, a rotation."""
    rng = stream(seed, "state")
    count, rows = len(data.episodes), data.episode
    n = len(rows)
    moving = data.observation[:, :3]
    speed = (
        np.gradient(moving, axis=0) * stream(seed, "heavy").lognormal(0, 1.5, count)[rows][:, None]
    )
    quaternion = rotations(n, seed) * rng.choice([-1.0, 1.0], size=(n, 1))
    place = (np.array([0.5, -0.2, 0.03]) + 0.05 * rng.normal(size=(count, 3)))[rows]
    constant = np.column_stack([np.full(n, 0.02), np.full(n, 1e-17), np.zeros(n)])
    odd = np.where(rng.random(count) < 0.2, 0.4, 0.02)[rows]  # another object in a fifth of them
    tiny = 1e-6 * rng.lognormal(0, 3, count)[rows]
    parts = [data.index * data.period_s, data.index, constant, odd, tiny, place, quaternion, speed,
             moving, rng.integers(0, 2, n)]  # fmt: skip
    whole = np.column_stack(parts)
    first = data.observation.shape[1]
    return replace(
        data, observation=np.hstack([data.observation, whole]),
        observation_names=(*data.observation_names, *(f"s{k}" for k in range(whole.shape[1]))),
        observation_scale=np.append(data.observation_scale, np.full(whole.shape[1], 0.1)),
        context={"states": slice(first, first + whole.shape[1])},
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(12))
def test_a_whole_state_of_a_simulator_has_no_unit(seed):
    assert measure(state(arms(700 + seed, epochs=1), seed), SETTINGS).findings == ()


@pytest.mark.parametrize("factor", [1000.0, 0.001])
def test_a_pose_in_another_unit_is_named_beside_its_quaternion(factor):
    data = arms(720, epochs=1)
    rng = stream(8, "pose")
    place = (np.array([0.5, -0.2, 0.03]) + 0.04 * rng.normal(size=(60, 3)))[data.episode]
    turn = np.repeat(rotations(60, 9), np.bincount(data.episode), axis=0)
    place = place * np.where(chosen(data, 0.3), factor, 1.0)[data.episode][:, None]
    posed = replace(
        data, observation=np.hstack([data.observation, place, turn]),
        observation_names=(*data.observation_names, *"xyzabcd"),
        observation_scale=np.append(data.observation_scale, np.full(7, 0.01)),
        context={"object": slice(3, 10)},
    )  # fmt: skip
    (found,) = measure(posed, SETTINGS).findings
    assert (found.kind, found.variable) == ("unit", "object")
