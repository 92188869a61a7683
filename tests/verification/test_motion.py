"""Journals of a real arm that were forged in one thing, each found by one rule of the motion."""

from copy import deepcopy
from dataclasses import replace
from itertools import product
from pathlib import Path

import mujoco
import numpy as np
import pytest

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.evidence.shadow.rig import (
    PERIOD_S,
    ROWS,
    Rig,
    StandInContext,
    StandInScene,
    passing_verdict,
)
from genpolicy.execution.journal import encode_actions
from genpolicy.feasibility.cell import cell_of
from genpolicy.feasibility.figures import expected_motion
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import read_yaml
from genpolicy.tasks.api import load_task
from genpolicy.verification.checker import check_messages
from genpolicy.verification.motion import HELD, SCENE, MotionProof

PARAMS = read_yaml(Path(__file__).parents[2] / "params.yaml")
HOME = np.array([0.0, -0.165, 0.0, -2.779, 0.0, 2.614, 0.785])
OPEN_M = 0.03
STILL = np.zeros(7)
TURNING = np.array([0.0] * 6 + [0.6 * PERIOD_S])
"""The last joint turns, and the tool with it, at .6 rad/s."""


@pytest.fixture(scope="module")
def task():
    return load_task("tabletop_insertion")


@pytest.fixture(scope="module")
def expected(task):
    period_s = HorizonConfig(**PARAMS["horizons"]).action_period_s
    assert period_s == PERIOD_S
    settings = FeasibilitySettings(**PARAMS["feasibility"])
    return expected_motion(cell_of(task, settings, action_period_s=period_s))


@pytest.fixture(scope="module")
def poses(task):
    """Rows of joint positions as actions of an open hand."""
    model = mujoco.MjModel.from_xml_path(str(task.scene_path))
    data, tcp = mujoco.MjData(model), int(model.site("tcp").id)

    def of(path_rad, opening_m=OPEN_M):
        rows = []
        for q_rad in path_rad:
            data.qpos[:7] = q_rad
            mujoco.mj_kinematics(model, data)
            rotation = rotation_to_6d(data.site_xmat[tcp].reshape(3, 3))
            rows.append([*data.site_xpos[tcp], *rotation, opening_m])
        return np.array(rows)

    return of


@pytest.fixture(scope="module")
def moved(poses):
    """The journal of an arm that goes on by the same step in every period, before and after."""

    def journal(step_rad, *, opening_m=OPEN_M, bodies=None):
        rig, scene = Rig(), StandInScene(bodies or {})
        path = HOME + np.arange(-3, ROWS + 1)[:, None] * step_rad
        actions = poses(path, opening_m)
        context = StandInContext(
            q_cmd=path[3], q_cmd_history=path[:3], q_meas=path[3], dq_meas=step_rad / PERIOD_S,
            last_action=actions[3], scene=scene,
        )  # fmt: skip
        rig.executor.see(0.0, scene.bodies)
        verdict = replace(passing_verdict(), q_rad=path[4:])
        rig.run(actions=actions[4:], verdict=verdict, context=context)
        told = [(e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload})
                for e in rig.end()]  # fmt: skip
        told[0][1]["checks_missing"] = []
        return told

    return journal


def rules(told, expected):
    report = check_messages(told, None, expected)
    assert report.reproved_actions == 8
    return {violation.rule for violation in report.violations}


def enqueued(told):
    return next(message for kind, message in told if kind == "enqueue")


@pytest.fixture
def still(moved):
    return moved(STILL)


def test_an_arm_that_stands_or_turns_within_its_limits_has_no_violation(moved, expected):
    assert not rules(moved(STILL), expected)
    assert not rules(moved(TURNING), expected)


def drawn(told, column, change, rows=slice(None)):
    """What was drawn is another chunk than what was admitted."""
    chunk = enqueued(told)
    raw = np.frombuffer(bytes.fromhex(chunk["actions"])).reshape(-1, 10).copy()
    raw[rows, column] = change(raw[rows, column])
    chunk["raw"] = encode_actions(raw)


@pytest.mark.parametrize("opening_m", [-0.0051, 0.0451, float("nan")])
@pytest.mark.parametrize("row", [0, ROWS - 1])
def test_a_gripper_that_was_told_to_leave_its_range_is_found(still, expected, opening_m, row):
    drawn(still, 9, lambda _: opening_m, row)
    assert rules(still, expected) == {"P6.gripper"}


@pytest.mark.parametrize("opening_m", [-0.005, 0.045])
def test_an_opening_within_the_tolerance_may_be_drawn(still, expected, opening_m):
    drawn(still, 9, lambda _: opening_m)
    assert not rules(still, expected)


@pytest.mark.parametrize("opening_m", [-0.001, 0.041])
def test_an_opening_that_nobody_brought_back_is_found(moved, expected, opening_m):
    """Drawn within the tolerance, and commanded as it was drawn."""
    assert rules(moved(STILL, opening_m=opening_m), expected) >= {"P6.gripper"}


@pytest.mark.parametrize("row", [0, ROWS - 1])
def test_a_chunk_that_was_moved_too_far_is_found(still, expected, row):
    drawn(still, 0, lambda x_m: x_m + 1.001 * expected.projection.moved_m, row)
    assert rules(still, expected) == {"P6.projection"}


def test_a_chunk_may_be_moved_by_as_much_as_is_allowed(still, expected):
    drawn(still, 0, lambda x_m: x_m + expected.projection.moved_m)
    assert not rules(still, expected)


@pytest.mark.parametrize(("turned_rad", "found"), [(0.1001, {"P6.projection"}), (0.0999, set())])
def test_a_chunk_that_was_turned_too_far_is_found(moved, poses, expected, turned_rad, found):
    told = moved(STILL)
    chunk, turned = enqueued(told), np.array([*HOME[:6], HOME[6] + turned_rad])
    chunk["raw"] = encode_actions(poses(np.tile(turned, (ROWS, 1))))
    raw, actions = (np.frombuffer(bytes.fromhex(chunk[key])) for key in ("raw", "actions"))
    assert np.abs(raw - actions).reshape(-1, 10)[:, :3].max() < 1e-12, "it moves no position"
    assert rules(told, expected) == found


def test_what_was_drawn_without_a_rotation_was_turned_by_no_angle(still, expected):
    drawn(still, slice(3, 9), np.zeros_like)
    assert rules(still, expected) == {"P6.projection"}


def test_a_tool_that_turns_too_fast_is_found(moved, expected):
    """By its own rule alone: no joint is as fast as a joint may be."""
    slow = replace(expected, tcp_turn_rad_s=0.59)
    assert rules(moved(TURNING), slow) == {"P6.tcp_turn"}
    assert not rules(moved(TURNING), replace(expected, tcp_turn_rad_s=0.61))


def test_the_first_row_turns_from_the_last_command(still, expected, poses):
    """Somebody says that the last command was turned away; its joints were not."""
    motion = enqueued(still)["motion"]
    before = np.array([*HOME[:6], HOME[6] - 0.1])
    motion["last_action"] = encode_actions(poses(before[None]))
    assert rules(still, expected) == {"P6.tcp_turn", "P6.commands"}


@pytest.mark.parametrize("share", [1.01, 0.99])
def test_an_arm_that_was_measured_at_another_speed_is_found(still, expected, share):
    """To stand still after it turned is a change of speed, over the time to the end of the row."""
    limit = expected.arm_rates[1]
    dq_rad_s = share * limit * PERIOD_S  # from where it was measured to the end of row 0
    enqueued(still)["motion"]["dq_meas_rad_s"] = encode_actions(dq_rad_s)
    assert rules(still, expected) == ({"P6.measured_acceleration"} if share > 1 else set())


def test_a_speed_that_nobody_measured_is_not_assumed(still, expected):
    enqueued(still)["motion"]["dq_meas_rad_s"] = None
    assert not rules(still, expected)


@pytest.fixture(scope="module")
def pressing(task, expected):
    """Where the target stands so that what is held reaches into it, and by how much, m."""
    model = mujoco.MjModel.from_xml_path(str(task.scene_path))
    name = model.body(int(model.site_bodyid[int(model.site("target").id)])).name
    proof = MotionProof(expected)
    for aside_m, below_m in product(np.linspace(0.004, 0.012, 9), np.linspace(-0.13, -0.06, 8)):
        proof._pose(HOME, 0.0, True, {})
        tcp_m = np.array(proof._data.site_xpos[proof._tcp])
        pose = tcp_m + np.array([aside_m, 0.0, below_m]), np.array([1.0, 0.0, 0.0, 0.0])
        proof._pose(HOME, 0.0, True, {name: encode_actions(np.concatenate(pose))})
        contact, groups = proof._data.contact, model.geom_group
        pairs = [sorted(groups[contact.geom[i]].tolist()) for i in range(proof._data.ncon)]
        depths = [-float(depth_m) for depth_m in contact.dist]
        scene = [i for i, pair in enumerate(pairs) if SCENE in pair]
        if scene and all(pairs[i] == [HELD, SCENE] for i in scene):
            depth_m = max(depths[i] for i in scene)
            if 0.002 < depth_m < 0.012:
                return {name: pose}, depth_m
    raise AssertionError("what is held reaches into the target nowhere")


def test_what_is_pressed_in_harder_than_its_phase_allows_is_found(moved, expected, pressing):
    bodies, depth_m = pressing
    told = moved(STILL, opening_m=0.0, bodies=bodies)
    force_n = expected.contact.stiffness_n_m * (depth_m - 1e-4)

    def held_to(limits):
        contact = replace(expected.contact, phases=frozenset({"approach"}), force_n=limits)
        return rules(deepcopy(told), replace(expected, contact=contact))

    assert held_to({"approach": 1.01 * force_n}) == set()
    assert held_to({"approach": 0.99 * force_n}) == {"P6.force"}
    assert held_to({"insert": 1.01 * force_n}) == {"P6.force"}, "another phase allows nothing here"
