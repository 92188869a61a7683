"""Operators feel for the hole: they succeed, they touch, and each searches its own way round."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion.episodes import MAXIMUM_EPISODE_S, demonstrate
from genpolicy.tasks.tabletop_insertion.experts import STYLES, Order
from genpolicy.tasks.tight_insertion.operators import (
    AROUND,
    CREEP_M_S,
    RING,
    RING_M,
    SearchingOperator,
)
from genpolicy.tasks.tight_insertion.start import HIDDEN, LEFT_OUT_Y_M, sample_start
from genpolicy.tasks.tight_insertion.task import PARTS, TASK
from genpolicy.tasks.tight_insertion.world import TightWorld

EPISODES = 12
PRESSED_N = 5.0


@pytest.fixture(scope="module")
def demonstrations():
    specs = TASK.episode_specs(8, EPISODES, shares={"nominal": 1.0})
    return specs, [demonstrate(spec, PARTS) for spec in specs]


def worst(side_x, side_y):
    """A start whose peg sits as far aside as any: the hole is felt only by searching."""
    return replace(
        sample_start(np.random.default_rng(1)), post_y_m=0.0, tilt_x_rad=0.0, tilt_y_rad=0.0,
        grip_x_m=side_x * HIDDEN["grip_x_m"][1], grip_y_m=side_y * HIDDEN["grip_y_m"][1],
    )  # fmt: skip


def operator(start, seed=4):
    world = TightWorld(start, settings=WorldSettings("epoch_1"))
    order = Order(kind="nominal", side="left", style=STYLES["amber"])
    return world, SearchingOperator(world, order=order, rng=np.random.default_rng(seed))


def searching(around):
    """The first operator of some who goes that way round."""
    return next(
        found for seed in range(20) if (found := operator(worst(1, 1), seed)[1])._around == around
    )


def test_nominal_episodes_succeed_without_a_forbidden_contact(demonstrations):
    """Of 300 of this plan 288 do; four in ten at the first try."""
    _, found = demonstrations
    assert sum(done.success for done in found) >= 10
    assert not any(done.collision for done in found)


def test_contact_happens_and_stays_below_what_insertion_may_press(demonstrations):
    _, found = demonstrations
    peak = np.array([np.linalg.norm(done.force, axis=1).max() for done in found])
    assert np.mean(peak > PRESSED_N) > 0.75
    assert peak.max() < 80.0


def test_only_in_phases_of_contact_does_anything_press(demonstrations):
    """What presses begins with the phase `insert`; forces are sampled at 100 Hz, phases at 20."""
    _, found = demonstrations
    for done in found:
        first = done.phases.index("insert")
        pressed = np.flatnonzero(np.linalg.norm(done.force, axis=1) > PRESSED_N)
        assert not len(pressed) or pressed[0] >= 5 * first - 5


def test_where_no_post_stands_the_way_is_straight_and_has_no_mode(demonstrations):
    specs, found = demonstrations
    free = [number for number, spec in enumerate(specs) if spec.start.post_left_out]
    assert free
    for number in free:
        path, start = found[number].robot[:, :3], specs[number].start
        hole = np.array([start.hole_x_m, start.hole_y_m])
        along = (hole - path[0, :2]) / np.linalg.norm(hole - path[0, :2])
        beside = (path[:, :2] - path[0, :2]) @ np.array([-along[1], along[0]])
        assert np.abs(beside).max() < 0.02
        seen = TightWorld(start, settings=WorldSettings("epoch_1")).observe()
        assert start.post_y_m == LEFT_OUT_Y_M
        assert TASK.mode_of(path, seen) == "unassigned"
    around = next(number for number in range(EPISODES) if number not in free)
    seen = TightWorld(specs[around].start, settings=WorldSettings("epoch_1")).observe()
    assert TASK.mode_of(found[around].robot[:, :3], seen) == specs[around].mode


def test_a_grasp_as_far_aside_as_any_is_found_and_not_always_at_once():
    tried = []
    for sides in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        world, own = operator(worst(*sides))
        while world.time_s < MAXIMUM_EPISODE_S and (action := own.act()) is not None:
            world.command(action)
            world.advance()
        assert world.success
        tried.append(own._tried)
    assert max(tried) > 1


def test_both_ways_round_are_taken_whatever_the_start():
    chosen = {operator(worst(1, 1), seed)[1]._around for seed in range(20)}
    assert chosen == set(AROUND)


def test_the_search_goes_round_its_ring_in_its_own_direction_and_then_between_the_points():
    for around, turn in zip(AROUND, (-1.0, 1.0), strict=True):
        own = next(
            found
            for seed in range(20)
            if (found := operator(worst(1, 1), seed)[1])._around == around
        )
        points = np.array([own._corrected() for _ in range(2 * RING)]) - own._middle
        assert np.linalg.norm(points, axis=1) == pytest.approx([RING_M] * 2 * RING)
        angles = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
        steps = np.full(2 * RING - 1, turn * 2 * np.pi / RING)
        steps[RING - 1] *= 1.5
        assert np.diff(angles) == pytest.approx(steps)


def test_off_the_rim_the_peg_is_pulled_no_faster_than_contact_allows():
    assert CREEP_M_S * 0.05 < 0.003
