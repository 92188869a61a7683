"""The classical planner plans from observations alone, around the post and into the hole."""

import numpy as np
import pytest

from genpolicy.contract.action import GRIPPER, POSITION
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.planner import PLANNER
from genpolicy.tasks.api import WorldSettings, load_task
from genpolicy.tasks.planner import planner_of
from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.observation import OBSERVATION, PHASES, one_hot
from genpolicy.tasks.tabletop_insertion.planner import (
    FINE_M,
    HOVER_Z_M,
    RING,
    RING_M,
    plan_insertion,
)

HORIZONS = HorizonConfig(
    observation_horizon=2, prediction_horizon=16, execution_horizon=8, action_period_s=0.05
)
TIP_ON_RIM_M = scene.FIXTURE_TOP_M + scene.TIP_OFFSET_M
HOLE_M = np.array([0.65, 0.0])


def seen(phase, tcp_m, *, before_m=None, post_y_m=0.0, hole_m=HOLE_M, force_n=0.0, opening_m=0.01):
    """Two observations of an arm that points straight down."""
    rows = [
        OBSERVATION.join({
            "tcp_position_m": np.array(at), "tcp_rotation": np.array([1.0, 0, 0, 0, -1.0, 0]),
            "gripper_opening_m": np.array([opening_m]), "wrench_n": np.array([0, 0, force_n]),
            "hole_pose": np.array([*hole_m, 1.0, 0.0]), "post_position_m": np.array([post_y_m]),
            "phase": one_hot(phase),
        })
        for at in (tcp_m if before_m is None else before_m, tcp_m)
    ]  # fmt: skip
    return np.stack(rows)


def planned(*args, **kwargs):
    return plan_insertion(seen(*args, **kwargs), horizons=HORIZONS)


@pytest.mark.parametrize(("tcp_y_m", "post_y_m", "hole_y_m", "side"), [
    (0.01, 0.0, 0.0, 1), (-0.01, 0.0, 0.0, -1), (0.0, 0.0, 0.02, 1), (0.0, 0.0, -0.02, -1),
    (0.0, 0.01, 0.0, -1), (0.0, -0.01, 0.0, 1), (0.0, 0.0, 0.0, 1),
])  # fmt: skip
def test_it_goes_round_the_post_on_the_shorter_side_and_of_equal_ones_on_the_left(
    tcp_y_m, post_y_m, hole_y_m, side
):
    hole_m = np.array([0.65, hole_y_m])
    chunk = planned("approach", [0.38, tcp_y_m, 0.15], post_y_m=post_y_m, hole_m=hole_m)
    assert np.sign(chunk[-1, 1] - tcp_y_m) == side and chunk.shape == (16, 10)


@pytest.mark.parametrize("phase", PHASES)
def test_the_gripper_lets_go_where_the_phase_allows_it_and_nowhere_else(phase):
    chunk = planned(phase, [0.65, 0.0, 0.08])
    opens = chunk[:, GRIPPER] > scene.RELEASE_OPENING_M
    assert opens[-1] == (phase in ("release", "retreat")) and opens.any() == opens[-1]


def test_what_presses_on_the_rim_goes_up_and_over_to_the_next_point_of_the_search():
    """From where it presses to, in steps that a motion in contact may take."""
    at = np.array([*HOLE_M, TIP_ON_RIM_M])
    chunk = planned("insert", at, force_n=30.0)
    assert chunk[0, 2] < at[2] < chunk[-1, 2] and np.diff(chunk[:, 2]).max() < 0.003
    np.testing.assert_allclose(chunk[-1, :2], HOLE_M + np.array([RING_M, 0.0]), atol=1e-9)
    last = np.pi * 2 * (RING - 1) / RING
    at_last = np.append(HOLE_M + RING_M * np.array([np.cos(last), np.sin(last)]), at[2])
    around = planned("insert", at_last, force_n=30.0)
    np.testing.assert_allclose(around[-1, :2], HOLE_M, atol=1e-9)
    down = planned("insert", at, force_n=5.0)
    assert down[-1, 2] < at[2] and np.abs(down[:, :2] - HOLE_M).max() < 1e-12


def test_it_waits_above_the_rim_until_it_stands_over_the_hole():
    high = TIP_ON_RIM_M + 0.02
    beside = planned("insert", [HOLE_M[0] - 0.004, 0.0, high])
    assert (beside[:, 2] == high).all() and beside[-1, 0] > HOLE_M[0] - 0.001
    assert planned("align", [HOLE_M[0] - 0.004, 0.0, high])[-1, 2] > high
    assert planned("align", [*HOLE_M, high])[-1, 2] < high


def test_nothing_it_was_asked_before_changes_an_answer_and_nothing_is_written_into_its_input():
    history = seen("approach", [0.40, -0.02, 0.15], before_m=[0.39, -0.015, 0.15])
    kept = history.copy()
    first = plan_insertion(history, horizons=HORIZONS)
    for phase in PHASES:
        planned(phase, [0.6, 0.03, 0.12], force_n=40.0)
    assert np.array_equal(plan_insertion(history, horizons=HORIZONS), first)
    assert np.array_equal(history, kept)


def test_from_starts_of_the_task_it_inserts_and_withdraws():
    """Without delay and checks; in the cell with both it is one of the methods of Gate D."""
    task = load_task("tabletop_insertion")
    planner = planner_of(task)
    assert planner is not None and PLANNER == "classical_planner"
    for seed in (0, 1):
        start = task.sample_start(np.random.default_rng(seed))
        world = task.make_world(start, settings=WorldSettings(task.calibration_epochs[-1]))
        before = world.observe()
        while not world.success and world.time_s < 8.0:
            now = world.observe()
            chunk = planner(np.stack([before, now]), horizons=HORIZONS)
            for action in chunk[:4]:
                before = world.observe()
                world.command(action)
                world.advance()
                assert not world.collision and world.contact_force_n < 40.0
        assert world.success, (seed, world.phase, world.last_action[POSITION])


@pytest.mark.parametrize("phase", ["approach", "recover"])
def test_where_no_way_is_left_it_stays(phase):
    """Wrong before: exactly above the hole there was one knot, and no spline through it."""
    hover_m = np.append(HOLE_M, HOVER_Z_M)
    chunk = planned(phase, hover_m)
    assert np.allclose(chunk[:, POSITION], hover_m, rtol=0.0, atol=FINE_M)
