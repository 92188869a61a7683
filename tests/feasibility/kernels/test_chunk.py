"""Kernels of one chunk: limits, rates, blending."""

import numpy as np
import pytest

from benchmarks.feasibility.plain import rate_excess as plain_excess
from genpolicy.contract.action import join_action
from genpolicy.feasibility.kernels.chunk import (
    DONE,
    NO_CHUNK,
    TURNS,
    blend,
    poses_of,
    project,
    rate_excess,
)
from genpolicy.robot.limits import PANDA

FIGURES = np.array([0.0, -1.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.04, 0.1, 0.2])
UPRIGHT = np.eye(3)


def rows(*x_m, opening=0.0, rotation=UPRIGHT):
    position = np.zeros((len(x_m), 3))
    position[:, 0] = x_m
    return join_action(position, np.broadcast_to(rotation, (len(x_m), 3, 3)), opening)


def projected(raw, last=None, begin=0):
    actions, changes = np.empty_like(raw), np.empty(2)
    last = rows(0.0)[0] if last is None else last
    return project(raw, last, begin, FIGURES, actions, changes), actions, changes


def test_what_keeps_to_all_limits_stays_as_it_is():
    raw = rows(0.05, 0.1, 0.2)
    state, actions, changes = projected(raw)
    assert state == DONE and np.array_equal(actions, raw)
    assert changes[0] == 0 and changes[1] == pytest.approx(0, abs=1e-12)


def test_a_leap_is_cut_and_late_rows_are_not():
    state, actions, changes = projected(rows(0.05, 0.5, 0.55))
    assert state == DONE
    assert np.allclose(actions[:, 0], [0.05, 0.15, 0.25])
    assert changes[0] == pytest.approx(0.35)
    state, actions, _ = projected(rows(0.9, 0.05, 0.1), begin=1)
    assert np.allclose(actions[:, 0], [0.9, 0.05, 0.1])


def test_box_and_opening_are_clipped():
    _, actions, _ = projected(rows(-0.05, opening=0.9))
    assert actions[0, 0] == 0.0 and actions[0, 9] == 0.04


def test_a_fast_turn_and_what_is_no_chunk_are_named():
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert projected(rows(0.05, rotation=quarter))[0] == TURNS
    assert projected(rows(0.05, 0.1), last=np.zeros(10))[0] == DONE  # nothing to turn from
    for column, value in ((0, np.nan), (9, np.inf), (slice(3, 9), 0.0)):
        raw = rows(0.05, 0.1)
        raw[1, column] = value
        state, _, changes = projected(raw)
        assert state == NO_CHUNK and np.isinf(changes).all()


@pytest.mark.parametrize("fixed", [1, 2, 3])
@pytest.mark.parametrize("points", [4, 19])
def test_rates_are_those_of_numpy(points, fixed):
    path = np.cumsum(np.random.default_rng(points).normal(0, 0.01, (points, 7)), axis=0)
    bounds = np.stack([PANDA.velocity_rad_s, PANDA.acceleration_rad_s2, PANDA.jerk_rad_s3])
    expected = plain_excess(path, fixed_points=fixed, limits=PANDA, period_s=0.05)
    assert rate_excess(path, fixed, bounds, 0.05) == pytest.approx(float(expected), rel=1e-12)


def test_blending_is_two_products():
    rng = np.random.default_rng(0)
    whole, on_path, on_fixed = rng.normal(0, 1, (7, 3)), rng.normal(0, 1, (5, 5)), np.ones((5, 2))
    result = np.empty_like(whole)
    blend(on_path, on_fixed, whole, 2, result)
    assert np.array_equal(result[:2], whole[:2])
    assert np.allclose(result[2:], on_path @ whole[2:] + on_fixed @ whole[:2], atol=1e-13)


def test_poses_of_a_path_and_whether_they_keep_to_the_limits(cell, kit):
    arm, q = cell.kinematics, np.tile(kit.HOME, (3, 1))
    position, rotation = arm.forward(q)
    last = join_action(position[0], rotation[0], 0.0)
    found, figures = np.zeros((2, 10)), FIGURES.copy()
    figures[:6] = [*position[0] - 0.01, *position[0] + 0.01]

    def keeps(path):
        return poses_of(arm.turns, arm.offsets, path, 1, last, figures, found)

    assert keeps(q)
    assert np.allclose(found[:, :9], last[:9], atol=1e-12)
    figures[0] += 0.02
    assert not keeps(q)  # outside of the box
    figures[:6] = [-2, -2, -2, 2, 2, 2]
    q[2, 6] += 0.3
    assert not keeps(q)  # turns too fast
    q[2, 6], q[2, 0] = kit.HOME[6], 0.3
    figures[9] = 1.0
    assert not keeps(q)  # leaps
    figures[8] = 1.0
    assert keeps(q)
