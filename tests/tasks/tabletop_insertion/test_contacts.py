"""Contacts: the post, the fixture, and the ways past them."""

from dataclasses import replace

import numpy as np
import pytest
from driving import drive

from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion.start import InsertionStart, sample_start
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld

SETTINGS = WorldSettings("epoch_1")


BESIDE = InsertionStart(
    tcp_x_m=0.65, tcp_y_m=0.07, tcp_z_m=0.15, yaw_rad=0.0,
    hole_x_m=0.65, hole_y_m=0.0, hole_yaw_rad=0.0, post_y_m=0.0,
)  # fmt: skip


@pytest.fixture
def start():
    return sample_start(stream(2, "world"))


def test_driving_straight_at_the_hole_hits_the_post(start):
    world = TabletopWorld(start, settings=SETTINGS)
    assert drive(world, np.array([0.48, 0.0, 0.15]))
    assert not world.success


def test_passing_the_post_on_one_side_does_not(start):
    world = TabletopWorld(start, settings=SETTINGS)
    assert not drive(world, np.array([0.40, 0.135, 0.15]))
    assert not drive(world, np.array([0.58, 0.135, 0.15]))


def test_pressing_the_peg_on_the_fixture_is_a_collision_with_a_force():
    world = TabletopWorld(replace(BESIDE, tcp_y_m=0.025), settings=SETTINGS)
    assert drive(world, np.array([0.65, 0.025, 0.10]))
    assert world.contact_force_n > 10.0
    assert world.wrench_n[2] > 10.0
