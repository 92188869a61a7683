"""Driving the hand from place to place."""

import numpy as np

from genpolicy.contract.action import GRIPPER
from genpolicy.tasks.tabletop_insertion.plans import travel


def drive(world, target_m, *, opening_m=0.01, speed_m_s=0.2):
    action = world.last_action
    collision = False
    for position in travel(
        np.array([action[:3], target_m]), speed_m_s=speed_m_s, acceleration_m_s2=0.8
    ):
        action[:3], action[GRIPPER] = position, opening_m
        world.command(action)
        world.advance()
        collision = collision or world.collision
    return collision
