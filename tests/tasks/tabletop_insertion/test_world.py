"""The simulated world: its determinism, and what it calls a success."""

from dataclasses import replace

import numpy as np
import pytest
from driving import drive

from genpolicy.contract.action import GRIPPER
from genpolicy.errors import ConfigError
from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion.start import InsertionStart, sample_start
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld

SETTINGS = WorldSettings("epoch_1")


BESIDE = InsertionStart(
    tcp_x_m=0.65, tcp_y_m=0.07, tcp_z_m=0.15, yaw_rad=0.0,
    hole_x_m=0.65, hole_y_m=0.0, hole_yaw_rad=0.0, post_y_m=0.0,
)  # fmt: skip


def wait(world, periods, *, opening_m):
    action = world.last_action
    action[GRIPPER] = opening_m
    for _ in range(periods):
        world.command(action)
        world.advance()


@pytest.fixture
def start():
    return sample_start(stream(2, "world"))


def test_equal_starts_and_actions_give_equal_states(start):
    hashes = []
    for _ in range(2):
        world = TabletopWorld(start, settings=SETTINGS)
        first = world.state_sha256()
        drive(world, world.last_action[:3] + np.array([0.0, 0.05, 0.0]))
        hashes.append((first, world.state_sha256()))
    assert hashes[0] == hashes[1]
    assert hashes[0][0] != hashes[0][1]


def test_another_start_has_another_hash(start):
    moved = replace(start, hole_x_m=start.hole_x_m + 1e-9)
    first, second = (TabletopWorld(s, settings=SETTINGS).state_sha256() for s in (start, moved))
    assert first != second


def test_starts_at_rest_where_it_should(start):
    world = TabletopWorld(start, settings=SETTINGS)
    position, _ = world.tcp_pose
    np.testing.assert_allclose(position, [start.tcp_x_m, start.tcp_y_m, start.tcp_z_m], atol=5e-4)
    assert np.abs(world.data.qvel[:7]).max() == 0.0
    assert world.phase == "approach" and world.holding and not world.success


def test_a_peg_dropped_beside_the_hole_is_no_success():
    world = TabletopWorld(BESIDE, settings=SETTINGS)
    drive(world, np.array([0.65, 0.07, 0.08]))
    wait(world, 10, opening_m=0.04)
    assert not world.holding
    drive(world, np.array([0.65, 0.07, 0.17]), opening_m=0.04)
    assert world.phase == "retreat"
    assert world.tip_depth_m > 0.025
    assert not world.success


def test_a_peg_let_go_in_the_hole_is_a_success_after_the_retreat_only():
    world = TabletopWorld(replace(BESIDE, tcp_y_m=0.0), settings=SETTINGS)
    assert not drive(world, np.array([0.65, 0.0, 0.074]))
    assert world.phase == "release"
    wait(world, 10, opening_m=0.04)
    assert not world.success
    assert not drive(world, np.array([0.65, 0.0, 0.15]), opening_m=0.04)
    assert world.success


def test_two_and_a_half_millimetres_of_error_are_forgiven():
    for error in ((0.0025, 0.0), (0.0, -0.0025), (0.0018, 0.0018)):
        x, y = 0.65 + error[0], error[1]
        world = TabletopWorld(replace(BESIDE, tcp_x_m=x, tcp_y_m=y), settings=SETTINGS)
        assert not drive(world, np.array([x, y, 0.074]))
        wait(world, 10, opening_m=0.04)
        assert not drive(world, np.array([x, y, 0.15]), opening_m=0.04)
        assert world.success


def test_a_push_shows_as_recovery_and_passes(start):
    world = TabletopWorld(start, settings=SETTINGS)
    world.apply_force(np.array([0.0, 110.0, 0.0]), 0.25)
    wait(world, 5, opening_m=0.01)
    assert world.phase == "recover"
    wait(world, 20, opening_m=0.01)
    assert world.phase == "approach"


def test_hold_keeps_the_target(start):
    world = TabletopWorld(start, settings=SETTINGS)
    drive(world, world.last_action[:3] + np.array([0.0, 0.03, 0.0]))
    wait(world, 10, opening_m=0.01)
    before = world.tcp_pose[0]
    for _ in range(10):
        world.hold()
        world.advance()
    assert np.linalg.norm(world.tcp_pose[0] - before) < 2e-4


@pytest.mark.parametrize(
    "settings", [WorldSettings("epoch_9"), WorldSettings("epoch_1", "no_such_probe")]
)
def test_unknown_settings_are_refused(start, settings):
    with pytest.raises(ConfigError, match="expected one of"):
        TabletopWorld(start, settings=settings)
