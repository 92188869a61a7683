from dataclasses import replace

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion import fallback
from genpolicy.tasks.tabletop_insertion.phases import INSERT_LEAVE_HEIGHT_M as LEAVES_M
from genpolicy.tasks.tabletop_insertion.scene import FIXTURE_TOP_M, TIP_OFFSET_M
from genpolicy.tasks.tabletop_insertion.start import InsertionStart
from genpolicy.tasks.tabletop_insertion.task import TASK

BASE = InsertionStart(
    tcp_x_m=0.38, tcp_y_m=0.0, tcp_z_m=0.15, yaw_rad=0.1,
    hole_x_m=0.65, hole_y_m=0.0, hole_yaw_rad=0.1, post_y_m=0.005,
)  # fmt: skip
PLACES = [(0.38, 0.0, 0.15), (0.42, 0.03, 0.15), (0.5, -0.13, 0.15), (0.6, 0.05, 0.15),
          (0.65, 0.0, 0.075)]  # fmt: skip


@pytest.mark.parametrize("kind", fallback.KINDS)
@pytest.mark.parametrize("place", PLACES)
def test_returns_without_touching_anything_forbidden(kind, place):
    start = replace(BASE, tcp_x_m=place[0], tcp_y_m=place[1], tcp_z_m=place[2])
    world = TASK.make_world(start, settings=WorldSettings("epoch_1"))
    if place[2] < 0.1:  # in the hole: the phase that allows the contact comes with one period
        world.hold()
        world.advance()
    plan = TASK.fallback(world, kind)
    for action in plan:
        world.command(action)
        world.advance()
        assert not world.collision
        assert np.all(action[:3] >= TASK.workspace.lower_m)
        assert np.all(action[:3] <= TASK.workspace.upper_m)
    end = plan[-1, :3]
    if kind == fallback.RETREAT:
        np.testing.assert_allclose(end, [place[0], place[1], fallback.SAFE_Z_M], atol=1e-9)
    else:
        np.testing.assert_allclose(end, [0.38, 0.0, 0.15], atol=1e-9)


def test_plans_keep_speed_and_jerk():
    plan = fallback.plan(
        fallback.CLASSICAL_RETURN,
        tcp_m=np.array([0.65, 0.0, 0.08]), yaw_rad=0.2, gripper_opening_m=0.04, post_y_m=0.0,
    )  # fmt: skip
    position = np.vstack([[0.65, 0.0, 0.08], plan[:, :3]])
    period = 0.05
    assert np.abs(np.diff(position, axis=0)).max() / period <= fallback.SPEED_M_S + 1e-9
    acceleration = np.diff(position, n=2, axis=0) / period**2
    assert np.abs(acceleration).max() <= fallback.ACCELERATION_M_S2 + 1e-6
    jerk = np.diff(position, n=3, axis=0) / period**3
    # Segments end between two actions, so a difference may span the end of one and the next begin.
    assert np.abs(jerk).max() <= 4 * fallback.JERK_M_S3
    assert (plan[:, 9] == 0.04).all()


@pytest.mark.parametrize("kind", fallback.KINDS)
@pytest.mark.parametrize("low", np.arange(0.08, 0.16, 0.01))
def test_what_is_held_is_lifted_as_contact_allows(kind, low):
    """Wherever the phase may be `insert`: no step goes further up than the contact layer forgives.

    Nor sideways: the hand is straight above until the phase can have ended.
    """
    begin = np.array([0.65, 0.0, low])
    plan = fallback.plan(
        kind, tcp_m=begin, yaw_rad=0.2, gripper_opening_m=0.01, post_y_m=0.0
    )  # fmt: skip
    path = np.vstack([begin, plan[:, :3]])
    left = int(np.argmax(path[:, 2] - TIP_OFFSET_M - FIXTURE_TOP_M > LEAVES_M))
    steps = np.diff(path, axis=0)[:left]
    assert left > 0 and steps[:, 2].max() <= FeasibilitySettings().step_tolerance_m
    assert np.abs(steps[:, :2]).max() == 0.0


def test_an_unknown_kind_is_refused():
    with pytest.raises(ContractError, match="one of"):
        fallback.plan(
            "resample", tcp_m=np.zeros(3), yaw_rad=0.0, gripper_opening_m=0.0, post_y_m=0.0
        )
