"""A body that moved since a chunk was checked: how far, and that nothing of the chunk moves."""

import math

import numpy as np
import pytest
from playing import judged

from genpolicy.evidence.shadow.rig import (
    CHECKPOINT,
    EXECUTION,
    IMITATED,
    SAMPLER,
    Rig,
)
from genpolicy.execution.checks import without
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal
from genpolicy.execution.scene import LEVER_M, moved_m, read_scene
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import Supervisor
from genpolicy.verification.moved import moved_m as independently_m

UPRIGHT = [1.0, 0.0, 0.0, 0.0]
LIMIT_M = EXECUTION.maximum_scene_shift_m


def at(x=0.0, y=0.0, yaw_rad=0.0, name="post"):
    half = yaw_rad / 2
    return read_scene({name: (np.array([x, y, 0.1]), [math.cos(half), 0.0, 0.0, math.sin(half)])})


def in_hex(scene):
    return {name: np.array(pose, "<f8").tobytes().hex() for name, pose in scene.items()}


@pytest.mark.parametrize(("now", "way_m"), [
    (at(), 0.0), (at(0.03, 0.04), 0.05), (at(yaw_rad=math.pi), 2 * LEVER_M),
    (at(yaw_rad=2 * math.pi), 0.0), (at(yaw_rad=-0.2), 2 * LEVER_M * math.sin(0.1)),
    (at(0.03, 0.04, 0.2), 0.05 + 2 * LEVER_M * math.sin(0.1)), (at(name="fixture"), math.inf),
    ({**at(), **at(name="fixture")}, math.inf), ({}, math.inf), (None, math.inf),
])  # fmt: skip
def test_how_far_a_body_has_moved(now, way_m):
    """Two words for it, and neither of them ours: a chord is twice radius times sine of half."""
    assert moved_m(at(), now) == moved_m(now, at()) == pytest.approx(way_m, abs=1e-8)
    told = None if now is None else in_hex(now)
    assert independently_m(in_hex(at()), told) == pytest.approx(way_m, abs=1e-8)


def test_the_body_that_moved_furthest_counts():
    before = {**at(), **at(name="fixture")}
    assert moved_m(before, {**at(0.01), **at(0.03, name="fixture")}) == pytest.approx(0.03)


@pytest.mark.parametrize("poses", [
    None, 3, "post", {"post": None}, {"post": ([0.0, 0.0], UPRIGHT)}, {3: ([0.0] * 3, UPRIGHT)},
    {"post": ([0.0, 0.0, math.nan], UPRIGHT)}, {"post": ([0.0] * 3, [0.0] * 4)},
    {"post": ([0.0] * 3, [2.0, 0.0, 0.0, 0.0])}, {"post": ([0.0] * 3, ["x"] * 4)},
])  # fmt: skip
def test_what_is_no_scene_is_unknown_and_nothing_is_executed_in_it(poses):
    assert read_scene(poses) is None
    rig = Rig()
    rig.run(2)
    rig.executor.see(rig.now_s, poses)
    rig.tick(2)
    assert rig.stub.accepted == 2
    assert rig.executor.conservation().rest_discarded == {"observation_divergence": 1}
    judged(rig)


@pytest.mark.parametrize(("says", "accepted"), [(False, 0), (True, 2)])
def test_a_session_that_never_says_its_scene_executes_nothing(says, accepted):
    """Whoever drives it may forget to; of a scene without bodies it says that there are none."""
    rig = Rig()
    rig.journal = Journal("driven by somebody else")
    rig.supervisor = Supervisor(rig.cell.execution, rig.journal, checks=IMITATED)
    rig.stub = ControllerStub(rig.cell, rig.journal, rig.supervisor, checks=IMITATED)
    rig.executor = Executor(rig.cell, rig.journal, rig.stub, checks=IMITATED)
    rig.executor.set_active(rig.now_s, CHECKPOINT, SAMPLER)
    rig.executor.controller(rig.now_s, rig.cell.controller_mode)
    if says:
        rig.see()
    rig.run(2)
    assert rig.stub.accepted == accepted
    refused = {} if says else {"observation_divergence": 1}
    assert rig.executor.conservation().chunks.discarded == refused
    judged(rig)


@pytest.mark.parametrize(("to_m", "accepted"), [(0.5 + LIMIT_M / 2, 4), (0.5 + 2 * LIMIT_M, 2)])
def test_between_enqueue_and_pop_a_body_that_moves_voids_what_is_here(to_m, accepted):
    rig = Rig()
    rig.see(post=0.5)
    rig.run(2)
    rig.see(post=to_m)
    rig.tick(2)
    assert rig.stub.accepted == accepted
    rig.run(2, predecessor_chunk_id="")  # what is checked in the new scene is executed
    assert rig.stub.accepted == accepted + 2
    judged(rig)


def test_it_is_held_against_the_scene_of_the_check_and_not_against_the_one_before():
    """Each step is small; what was checked is left behind all the same."""
    rig = Rig()
    rig.see(post=0.5)
    rig.run(1)
    for step in range(1, 4):
        rig.see(post=0.5 + 0.6 * step * LIMIT_M)
        rig.tick(1)
    assert rig.stub.accepted == 2
    judged(rig)


def test_a_body_that_moved_on_the_way_keeps_a_chunk_out_and_back_lets_it_in():
    rig = Rig()
    rig.see(post=0.5)
    rig.observe()
    late, again = rig.chunk(), rig.chunk()
    rig.see(post=0.6)
    assert rig.deliver(late) == "observation_divergence"
    rig.see(post=0.5)
    assert rig.deliver(again) is None
    judged(rig)


def test_a_body_that_comes_or_goes_voids():
    for now in ({}, {"post": 0.5, "box": 0.1}):
        rig = Rig()
        rig.see(post=0.5)
        rig.run(1)
        rig.see(**now)
        rig.tick(1)
        assert rig.stub.accepted == 1
        judged(rig)


@pytest.mark.parametrize("blind", ["checks", "stub_checks"])
def test_executor_and_stub_each_look_for_themselves(blind):
    rig = Rig(**({"stub_checks": IMITATED} | {blind: without(IMITATED, "scene")}))
    rig.see(post=0.5)
    rig.run(1)
    rig.see(post=0.6)
    rig.tick(1)
    assert rig.stub.accepted == 1 and rig.stub.stale == (blind == "checks")
